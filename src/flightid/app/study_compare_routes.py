"""Answers about two studies side by side: the results of their last runs."""

from __future__ import annotations

import asyncio
from pathlib import Path

from fastapi import FastAPI, HTTPException

from flightid.app.backstage import Backstage, made
from flightid.app.compare_schemas import StudyComparison, StudyPairRequest
from flightid.app.kept_parts import kept_part
from flightid.app.own_folders import is_link
from flightid.app.rigs import Rigs
from flightid.app.run_schemas import RunPart
from flightid.app.studies import text_of
from flightid.app.study_compare_work import make_study_comparison
from flightid.app.study_edits import etag_of, parts_of
from flightid.app.workspace import Workspace
from flightid.models.saved_files import MODELS
from flightid.study.output import WRITTEN

LONGEST = 24
"""Letters of a name that heads a column."""


def add_study_compare_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the screen Compare asks of two studies."""
    workers = backstage.workers

    @app.post("/api/comparisons/studies")
    async def compare(asked: StudyPairRequest) -> StudyComparison:
        if asked.before == asked.after:
            raise HTTPException(422, "This is one study: choose another to stand beside it.")
        told = [
            await asyncio.to_thread(_ran, backstage, each) for each in (asked.before, asked.after)
        ]
        names = (told[0][0], told[1][0])
        called = column_names(*names)
        folders = {name: folder for name, (_, folder, _) in zip(called, told, strict=True)}
        changed = [name for name, (_, _, since) in zip(names, told, strict=True) if since]
        answer = await made(workers.compared(make_study_comparison, folders))
        return StudyComparison(names=names, changed=changed, **answer)


def _ran(backstage: Backstage, log: str) -> tuple[str, Path, bool]:
    """Name, the folder of the last run, and whether models have changed since.

    Raises
    ------
    HTTPException
        404 where there is no study, or no run of it.
    """
    workspace = backstage.workspace
    name = _name_of(workspace, log)
    path = backstage.studies.path(log)
    if path is None:
        if workspace.log_path(log) is None:
            raise HTTPException(404, f"{name} has no study: open it, and write one first.")
        raise HTTPException(
            404,
            f"{name} has no study, so there are no models of it to compare: a log has one from "
            "when it is opened, if it can carry a model. Its screen Flight says what it lacks.",
        )
    part = kept_part(workspace, log, "run")
    if not isinstance(part, RunPart):
        raise HTTPException(404, f"The study of {name} was not run yet: open Verify, fit first.")
    folder = workspace.result_path(log, "run.json").parent / part.folder
    planted = is_link(folder) or is_link(folder / MODELS)
    if planted or not (folder / WRITTEN).is_file():
        raise HTTPException(404, f"What the run of {name} wrote is gone; fit again.")
    text = text_of(path)
    same = etag_of(text) == part.etag or parts_of(text).models == part.parts.models
    return name, folder, not same


def _name_of(workspace: Workspace, log: str) -> str:
    path = workspace.log_path(log)
    if path is not None:
        return path.name
    rigs = Rigs(workspace)
    if not rigs.files(log):
        raise HTTPException(404, "The workspace holds no such log or records.")
    return rigs.name_of(log)


def column_names(before: str, after: str) -> tuple[str, str]:
    """What columns call both: their names, else, of long or equal ones, before and after.

    Example
    -------
    >>> column_names("monday.bin", "friday.bin"), column_names("a.csv", "a.csv")
    (('monday.bin', 'friday.bin'), ('before', 'after'))
    """
    told = (before, after)
    return told if before != after and max(map(len, told)) <= LONGEST else ("before", "after")
