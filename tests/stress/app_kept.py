"""What the page was told is done, and what of it is gone or half after a kill."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from flightid.app.kept_parts import PARTS
from flightid.files import sha256_of_file
from flightid.study.settings import read_settings

if TYPE_CHECKING:
    from tests.stress.app_session import Session


@dataclass
class Kept:
    """What the page was told.

    Attributes
    ----------
    folder : Path
        Workspace.
    studies : dict of str to list of str
        The text of each study that was answered last.
    changing : str
        The log whose study an edit was sent for that is not answered: it may be there or not.
    begun : dict of (str, str) to str
        Jobs, by kind and log, that were begun and not seen to end.
    """

    folder: Path
    number: int = 0
    logs: list[str] = field(default_factory=list)
    overviews: list[str] = field(default_factory=list)
    studies: dict[str, list[str]] = field(default_factory=dict)
    changing: str = ""
    models: dict[str, str] = field(default_factory=dict)
    runs: dict[str, str] = field(default_factory=dict)
    begun: dict[tuple[str, str], str] = field(default_factory=dict)


def losses(kept: Kept, session: Session) -> list[str]:
    """What is gone, half, or not offered again."""
    said = [*_files(kept), *_shown(kept, session), *_begun(kept, session)]
    kept.changing = ""
    kept.begun.clear()
    return said


def _files(kept: Kept) -> Iterator[str]:
    """What the disk holds: nothing acknowledged is missing, nothing that is there is half."""
    folder = kept.folder
    for path in (folder / "logs").glob("*/*"):
        if sha256_of_file(path)[:16] != path.parent.name:
            yield f"half of a log: {path}"
    for log in kept.logs:
        if not list((folder / "logs" / log).glob("*")):
            yield f"log {log} is gone"
    for path in (folder / "studies").glob("[!.]*.toml"):
        read_settings(path)
        text = path.read_text(encoding="utf-8")
        known = kept.studies.get(path.stem)
        if known is not None and kept.changing != path.stem and text not in known:
            yield f"study {path.stem} is not what was answered"
        if known is not None:
            kept.studies[path.stem] = [text]
    for name, text in kept.models.items():
        path = folder / "models" / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            yield f"model {name} is gone or half"
    yield from _results(folder / ".flightid" / "results")


def _results(folder: Path) -> Iterator[str]:
    for path in folder.rglob("*"):
        if path.name.startswith(".") or ".tmp" in path.name or path.is_dir():
            continue
        if path.stat().st_size == 0:
            yield f"empty: {path}"
        if path.suffix == ".html" and not path.read_bytes().rstrip().endswith(b"</html>"):
            yield f"half of a page: {path}"
        if ".json" not in path.name:
            continue
        try:
            told = json.loads(path.read_bytes())
            if (kind := path.name.partition(".")[0]) in PARTS and path.parent.parent == folder:
                PARTS[kind].model_validate(told)
        except ValueError as error:
            yield f"half of {path}: {error}"


def _shown(kept: Kept, session: Session) -> Iterator[str]:
    """What the page shows: all that was finished, without being made again."""
    listed = {each["id"]: each for each in session.ask("/api/workspace")["logs"]}
    yield from (f"log {log} is not listed" for log in kept.logs if log not in listed)
    for log in kept.overviews:
        if session.ask(f"/api/logs/{log}")["overview"] is None:
            yield f"the verdict of {log} is gone"
        if log not in kept.studies:
            continue
        told = session.ask(f"/api/studies/{log}")
        if told is None or told["text"] not in kept.studies[log]:
            yield f"the study of {log} is not shown as it was answered"
    for log, etag in kept.runs.items():
        told = session.ask(f"/api/runs/{log}")["run"]
        if told is None or told["etag"] != etag:
            yield f"the run of {log} is gone"
            continue
        if "</html>" not in session.ask(f"/api/runs/{log}/report")[-20:]:
            yield f"the report of {log} is half"
        if told["figures"]:
            session.ask(f"/api/runs/{log}/figures/{told['figures'] - 1}")
    if kept.overviews and not session.shows(kept.overviews[-1]):
        yield "the screen Flight is half"


def _begun(kept: Kept, session: Session) -> Iterator[str]:
    """What was begun is there, or goes on, or is offered again."""
    for kind, log in kept.begun:
        jobs = [each for each in session.ask("/api/jobs") if each["id"] == f"{kind}-{log}"]
        place = f"/api/{'logs' if kind == 'overview' else 'runs'}/{log}"
        if session.ask(place)[kind] is None and not jobs:
            yield f"{kind} of {log} was begun and is not offered again"
        if jobs and jobs[0]["state"] not in ("waiting", "interrupted", "failed"):
            yield f"{kind} of {log} is said to be {jobs[0]['state']}"
        if kind == "run" and jobs and not session.offers(log):
            yield f"run of {log} is not offered on its screen"
