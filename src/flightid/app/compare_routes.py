"""Answers about comparisons and plans: two sides, the next flight, its card."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

from fastapi import FastAPI, HTTPException, Query, Response
from pydantic import ValidationError

from flightid.app import compare_work, gain_work
from flightid.app.backstage import Backstage, LogName, known_log, made
from flightid.app.compare_schemas import (
    CompareRequest,
    ComparisonPart,
    PlanPart,
    PlanRequest,
    PlanWishes,
)
from flightid.app.gain_answers import kept_gains
from flightid.app.guard import SANDBOXED
from flightid.app.studies import text_of


def add_compare_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the screens Compare and Plan ask."""
    workspace, workers = backstage.workspace, backstage.workers

    @app.post("/api/comparisons")
    async def compare(asked: CompareRequest) -> ComparisonPart:
        before = known_log(workspace, asked.before.log)
        after = known_log(workspace, asked.after.log)
        study, text = workspace.study_path(asked.before.log), ""
        if asked.before.promised:
            if backstage.studies.path(asked.before.log) is None:
                raise HTTPException(404, "This log has no study that could promise anything.")
            text = text_of(study)
        sides = (asked.before, asked.after)
        inputs = (compare_work.make_comparison, before, after, sides, study, text)
        if not asked.before.promised:
            return ComparisonPart(**await made(workers.compared(*inputs)))
        # Which step flew rests on the study's gains; a study without any may still promise.
        told, files = await asyncio.gather(
            made(workers.compared(*inputs)), _files(backstage, asked.before.log, study, text)
        )
        if files:
            told = await made(workers.compared(*inputs, files))
        return ComparisonPart(**told)

    @app.post("/api/plans")
    async def plan(asked: PlanRequest) -> PlanPart:
        log = known_log(workspace, asked.log)
        return PlanPart(
            **await made(workers.planned(compare_work.make_plan, log, asked.wishes.given()))
        )

    @app.get("/api/plans/{log}/card", response_class=Response)
    async def card(log: LogName, wishes: Annotated[str, Query(max_length=2000)] = "{}") -> Response:
        path = known_log(workspace, log)
        try:
            given = PlanWishes.model_validate_json(wishes).given()
        except ValidationError as error:
            raise HTTPException(422, "The wishes are none that a plan knows.") from error
        page = await made(workers.planned(compare_work.make_card, path, given))
        return Response(
            page, media_type="text/html", headers={"content-security-policy": SANDBOXED}
        )


async def _files(backstage: Backstage, log: str, study: Path, text: str) -> list[dict[str, str]]:
    """Files of the study's gains, found before where they were; none where it has none to fly."""
    *_, kept = await asyncio.to_thread(kept_gains, backstage, log)
    if kept is not None:
        return [each.model_dump() for each in kept.files]
    files, refusal, _ = await backstage.workers.tuned(gain_work.make_files, study, text)
    return [] if refusal else files
