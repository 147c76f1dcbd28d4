"""Answers about the study of a log: its text, edits of one who has seen the last version."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Annotated

from fastapi import FastAPI, Header, HTTPException, Response

from flightid.app.backstage import Backstage, LogName
from flightid.app.schemas import Edits, MergedStudy, StudyStep, StudyText, TwoStudies, WholeText
from flightid.app.study_edits import KeyEdit
from flightid.app.study_merge import merge_studies


def add_study_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what every screen asks of the study."""
    studies = backstage.studies

    @app.get("/api/studies/{log}")
    async def study(log: LogName, response: Response) -> StudyText | None:
        found = await asyncio.to_thread(studies.read, log)
        return None if found is None else _tagged(found, response)

    @app.patch("/api/studies/{log}")
    async def change(
        log: LogName,
        edits: Edits,
        response: Response,
        if_match: Annotated[str | None, Header()] = None,
    ) -> StudyText:
        return await _stored(studies.change, log, edits, if_match, response)

    @app.post("/api/studies/{log}")
    async def replace(
        log: LogName,
        whole: WholeText,
        response: Response,
        if_match: Annotated[str | None, Header()] = None,
    ) -> StudyText:
        return await _stored(studies.replace, log, whole, if_match, response)

    @app.post("/api/studies/{log}/step")
    async def step(
        log: LogName,
        steps: StudyStep,
        response: Response,
        if_match: Annotated[str | None, Header()] = None,
    ) -> StudyText:
        return await _stored(studies.step, log, steps, if_match, response)

    @app.post("/api/studies/{log}/merge")
    async def merge(log: LogName, two: TwoStudies) -> MergedStudy:
        """Compare two versions; nothing is written."""
        if studies.path(log) is None:
            raise HTTPException(404, "This log has no study.")
        edits = [KeyEdit(tuple(each.path), each.value) for each in two.edits]
        return await asyncio.to_thread(merge_studies, two.base, two.mine, two.theirs, edits)


async def _stored(
    store: Callable[..., StudyText | None],
    log: str,
    sent: object,
    tag: str | None,
    response: Response,
) -> StudyText:
    if tag is None:
        raise HTTPException(428, "If-Match must say which version of the study is changed.")
    return _tagged(await asyncio.to_thread(store, log, sent, tag), response)


def _tagged(found: StudyText | None, response: Response) -> StudyText:
    if found is None:
        raise HTTPException(404, "This log has no study.")
    response.headers["etag"] = found.etag
    return found
