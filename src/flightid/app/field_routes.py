"""Answers about fields of a log: which there are, and a view of some over a span."""

from __future__ import annotations

import asyncio
import hashlib
import math
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import numpy as np
from fastapi import FastAPI, HTTPException, Query, Response

from flightid.app import work
from flightid.app.backstage import Backstage, LogName, known_log, made
from flightid.app.jobs import Workers
from flightid.app.kept_parts import kept_fields
from flightid.app.own_folders import is_link
from flightid.app.plot_schemas import FormulaUnit
from flightid.app.pyramid import Pyramid, view
from flightid.app.schemas import FieldGroup
from flightid.app.workspace import Workspace
from flightid.logs.field_formula import FIELD, LONGEST

MOST_SERIES, MOST_COLUMNS = 12, 8000


def add_field_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what panes of the page ask."""
    workspace, workers = backstage.workspace, backstage.workers

    @app.get("/api/logs/{log}/fields")
    async def fields(log: LogName) -> list[FieldGroup]:
        path = known_log(workspace, log)
        if (found := kept_fields(workspace, log)) is None:
            target = workspace.result_path(log, "fields.json")
            await made(workers.live(work.make_fields, path, target))
            found = kept_fields(workspace, log)
        return found or []

    @app.get("/api/logs/{log}/formula")
    async def formula(
        log: LogName, text: Annotated[str, Query(min_length=1, max_length=LONGEST)]
    ) -> FormulaUnit:
        """Whether a formula of fields can be plotted, and in what unit."""
        path = known_log(workspace, log)
        _, unit = await _formula(workspace, workers, log, path, text.strip())
        return FormulaUnit(series=f"={text.strip()}", unit=unit)

    @app.get("/api/logs/{log}/view", response_class=Response)
    async def seen(
        log: LogName,
        series: Annotated[list[str], Query(min_length=1, max_length=MOST_SERIES)],
        start_s: float,
        stop_s: float,
        columns: Annotated[int, Query(ge=10, le=MOST_COLUMNS)],
    ) -> Response:
        if not (math.isfinite(start_s) and math.isfinite(stop_s) and start_s < stop_s):
            raise HTTPException(422, "A span needs two instants, the first before the last.")
        path = known_log(workspace, log)
        levels = [await _pyramid(workspace, workers, log, path, each) for each in series]
        table = await asyncio.to_thread(view, levels, (start_s, stop_s), columns)
        head = np.array(table.shape[::-1], np.float64)
        return Response(head.tobytes() + table.tobytes(), media_type="application/octet-stream")


async def _formula(
    workspace: Workspace, workers: Workers, log: str, path: Path, formula: str
) -> tuple[Path, str]:
    """Levels of a formula, made anew, and its unit."""
    target = _target(workspace, log, f"={formula}")
    return target, await made(workers.live(work.make_formula, path, formula, target))


def _target(workspace: Workspace, log: str, series: str) -> Path:
    name = hashlib.sha256(series.encode()).hexdigest()[:24]
    return workspace.result_path(log, f"{name}.npy").with_suffix(".npy")


async def _pyramid(
    workspace: Workspace, workers: Workers, log: str, path: Path, series: str
) -> Pyramid:
    """Levels of a field, made where they are not there yet."""
    match = FIELD.fullmatch(series)
    if match is None and not series.startswith("="):
        raise HTTPException(422, "A series is named MESSAGE.FIELD or MESSAGE[instance].FIELD.")
    target = _target(workspace, log, series)
    with suppress(OSError, ValueError, IndexError, EOFError):
        if not is_link(target):
            return await asyncio.to_thread(Pyramid.read, target)
    # Not there, or broken; the new one takes its place.
    if series.startswith("="):
        await _formula(workspace, workers, log, path, series[1:])
        return await asyncio.to_thread(Pyramid.read, target)
    assert match is not None
    message, number, field = match.groups()
    instance = None if number is None else int(number)
    await made(workers.live(work.make_pyramid, path, message, instance, field, target))
    return await asyncio.to_thread(Pyramid.read, target)
