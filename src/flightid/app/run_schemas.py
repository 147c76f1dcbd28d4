"""What page and server tell each other of a study that was run whole."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from flightid.app.schemas import Job, Light, Message, StudyParts

RUN = r"^run-[0-9a-f]{16}$"
"""Name of the folder of a run: nothing that leads elsewhere."""


class RunPart(Message):
    """What a run of the study made: its report as a tree, figures by their number."""

    etag: str
    parts: StudyParts
    folder: str = Field(pattern=RUN)
    title: str
    verdict: Light
    tally: str
    seconds: float
    figures: int
    sections: list[dict[str, Any]]


class RunScreen(Message):
    """The last run that ended, the one that goes on, and files that a zip leaves out."""

    run: RunPart | None
    jobs: list[Job]
    left_out: list[str]
