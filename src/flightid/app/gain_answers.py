"""Answers about gains: those of a study, and of an axis on the socket while a slider moves."""

from __future__ import annotations

import asyncio

from fastapi import FastAPI, HTTPException

from flightid.app import gain_work
from flightid.app.backstage import Backstage, LogName
from flightid.app.gain_schemas import (
    AxisGains,
    GainsAnswer,
    GainsPart,
    GainsQuestion,
    GainsScreen,
)
from flightid.app.kept_parts import kept_part
from flightid.app.schemas import Question
from flightid.app.study_edits import KeyEdit, etag_of
from flightid.errors import FlightidError


async def answer_gains(question: Question, backstage: Backstage) -> GainsAnswer:
    """An axis with other gains than its study has."""
    assert isinstance(question, GainsQuestion)
    try:
        path, text = backstage.studies.opened(question.log)
    except FlightidError as error:
        return GainsAnswer(request=question.request, error=str(error))
    edits = [KeyEdit(tuple(each.path), each.value) for each in question.edits]
    values, refusal, seconds = await backstage.workers.tuned(
        gain_work.move_axis,
        path,
        text,
        edits,
        question.axis,
        question.values,
        question.responses,
    )
    told = None if refusal else AxisGains(**values)
    return GainsAnswer(request=question.request, moved=told, error=refusal or None, seconds=seconds)


def kept_gains(backstage: Backstage, log: str) -> tuple[str, str, GainsPart | None]:
    """Tag and version of a study as it stands, and its gains where they were found before.

    Raises
    ------
    StudyError
        It names files outside the folder, or cannot be carried out as written.
    """
    path, text = backstage.studies.opened(log)
    version = gain_work.gains_version(path, text)
    found = kept_part(backstage.workspace, log, "gains", version)
    return etag_of(text), version, found if isinstance(found, GainsPart) else None


def add_gain_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the screen Gains asks."""

    @app.post("/api/gains/{log}")
    async def gains(log: LogName, again: bool = False) -> GainsScreen:
        """Those of the study as it stands; the work on them begins where they are not there."""
        path = backstage.studies.path(log)
        if path is None:
            raise HTTPException(404, "This log has no study.")
        etag, version, part = await asyncio.to_thread(kept_gains, backstage, log)
        backstage.workers.ensure("gains", log, path, again=again, of=version)
        if part is not None:
            text = path.read_text(encoding="utf-8")
            key = f"{log} {gain_work.plants_key(text)}"
            backstage.workers.prepare(key, gain_work.prepare_plants, path, text)
        jobs = [job for job in backstage.workers.of_log(log) if job.kind == "gains"]
        return GainsScreen(etag=etag, gains=part, jobs=jobs)
