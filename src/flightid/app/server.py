"""The server: what the page asks for, answered from the workspace and from the workers."""

from __future__ import annotations

import asyncio
import hashlib
import json
import math
import re
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from fastapi import FastAPI, Header, HTTPException, Query, Request, Response
from fastapi.exceptions import RequestValidationError

from flightid.app import work
from flightid.app.guard import UPLOAD_BYTES
from flightid.app.jobs import KINDS, Workers
from flightid.app.kept_parts import kept_fields, kept_overview, kept_review
from flightid.app.live import add_socket
from flightid.app.own_folders import is_link, shown_name
from flightid.app.pyramid import Pyramid, view
from flightid.app.schemas import (
    Edits,
    FieldGroup,
    FlightScreen,
    Job,
    LeftOut,
    Listing,
    LogItem,
    StudyText,
    WholeText,
)
from flightid.app.studies import Studies
from flightid.app.workspace import Workspace
from flightid.errors import FlightidError
from flightid.version import VERSION

SERIES = re.compile(r"([^.\[\]]{1,200})(?:\[(\d{1,4})\])?\.(.{1,200})")
MOST_SERIES, MOST_COLUMNS = 12, 8000
MOST_LOOKED_AT = 200
"""Logs that a listing has inspected, one after the other; others when they are opened."""

Log = Annotated[str, "first 16 digits of the SHA-256 of its bytes"]


def make_server(workspace: Workspace, page: Mapping[str, tuple[str, bytes]]) -> FastAPI:
    """Everything that is answered; `Guard` stands before it.

    Parameters
    ----------
    workspace : Workspace
    page : mapping of str to (str, bytes)
        Files of the page with their types.
    """
    workers = Workers(workspace)

    @asynccontextmanager
    async def lifespan(served: FastAPI) -> AsyncIterator[None]:
        del served
        workers.start()
        yield
        await asyncio.to_thread(workers.stop)
        workspace.index.close()

    app = FastAPI(
        title="flightid",
        version=VERSION,
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        lifespan=lifespan,
    )
    for refused in (FlightidError, OSError, RequestValidationError):
        app.add_exception_handler(refused, _refused)
    studies = Studies(workspace)
    _add_logs(app, workspace, workers)
    _add_jobs(app, workspace, workers)
    _add_studies(app, studies)
    add_socket(app, studies, workers)
    _add_page(app, page)  # last: it takes every path that is left
    return app


async def _refused(request: Request, error: Exception) -> Response:
    """The sentence of a refusal, in ASCII: what was sent may be no text that has a UTF-8."""
    del request
    said = str(error)
    if isinstance(error, RequestValidationError):
        places = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()]
        said = "; ".join(places)
    return Response(json.dumps({"error": said}), 422, media_type="application/json")


def _add_page(app: FastAPI, page: Mapping[str, tuple[str, bytes]]) -> None:
    @app.get("/", include_in_schema=False)
    async def index() -> Response:
        return _file("index.html")

    @app.get("/{name:path}", include_in_schema=False)
    async def part(name: str) -> Response:
        # Browsers ask for this name where a page that is left at once names another.
        return _file("icon.svg" if name == "favicon.ico" else name)

    def _file(name: str) -> Response:
        if name not in page:
            raise HTTPException(404, "There is no such page.")
        kind, content = page[name]
        return Response(content, media_type=kind)


def _add_logs(app: FastAPI, workspace: Workspace, workers: Workers) -> None:
    @app.get("/api/workspace")
    async def listing() -> Listing:
        await asyncio.to_thread(workspace.scan)
        made = await asyncio.to_thread(_listing, workspace)
        for each in [log for log in made.logs if log.light is None][:MOST_LOOKED_AT]:
            if (path := workspace.log_path(each.id)) is not None:
                workers.ensure("overview", each.id, path)
        return made

    @app.put("/api/logs")
    async def upload(request: Request, name: Annotated[str, Query(max_length=300)]) -> LogItem:
        length = int(request.headers.get("content-length", 0))
        if length > UPLOAD_BYTES:
            raise HTTPException(413)
        log = await workspace.take(name, request.stream())
        path = _known(workspace, log)
        workers.ensure("overview", log, path)
        return next(each for each in _listing(workspace).logs if each.id == log)

    @app.get("/api/logs/{log}")
    async def flight(log: Log) -> FlightScreen:
        path = _known(workspace, log)
        for kind in KINDS:
            workers.ensure(kind, log, path)
        return FlightScreen(
            id=log,
            name=path.name,
            path=path.relative_to(workspace.folder).as_posix(),
            overview=kept_overview(workspace, log),
            review=kept_review(workspace, log),
            jobs=workers.of_log(log),
        )

    @app.get("/api/logs/{log}/fields")
    async def fields(log: Log) -> list[FieldGroup]:
        path = _known(workspace, log)
        if (found := kept_fields(workspace, log)) is None:
            target = workspace.result_path(log, "fields.json")
            await _made(workers.live(work.make_fields, path, target))
            found = kept_fields(workspace, log)
        return found or []

    @app.get("/api/logs/{log}/view", response_class=Response)
    async def seen(
        log: Log,
        series: Annotated[list[str], Query(min_length=1, max_length=MOST_SERIES)],
        start_s: float,
        stop_s: float,
        columns: Annotated[int, Query(ge=10, le=MOST_COLUMNS)],
    ) -> Response:
        if not (math.isfinite(start_s) and math.isfinite(stop_s) and start_s < stop_s):
            raise HTTPException(422, "A span needs two instants, the first before the last.")
        path = _known(workspace, log)
        made = [await _pyramid(workspace, workers, log, path, each) for each in series]
        table = await asyncio.to_thread(view, made, (start_s, stop_s), columns)
        head = np.array(table.shape[::-1], np.float64)
        return Response(head.tobytes() + table.tobytes(), media_type="application/octet-stream")


async def _pyramid(
    workspace: Workspace, workers: Workers, log: str, path: Path, series: str
) -> Pyramid:
    """Levels of a field, made where they are not there yet."""
    match = SERIES.fullmatch(series)
    if match is None:
        raise HTTPException(422, "A series is named MESSAGE.FIELD or MESSAGE[instance].FIELD.")
    message, number, field = match.groups()
    name = hashlib.sha256(series.encode()).hexdigest()[:24]
    target = workspace.result_path(log, f"{name}.npy").with_suffix(".npy")
    with suppress(OSError, ValueError, IndexError, EOFError):
        if not is_link(target):
            return await asyncio.to_thread(Pyramid.read, target)
    # Not there, or broken; the new one takes its place.
    instance = None if number is None else int(number)
    await _made(workers.live(work.make_pyramid, path, message, instance, field, target))
    return await asyncio.to_thread(Pyramid.read, target)


async def _made(work_done: Awaitable[tuple[Any, str, float]]) -> None:
    _, refusal, _ = await work_done
    if refusal:
        raise HTTPException(422, refusal)


def _known(workspace: Workspace, log: str) -> Path:
    path = workspace.log_path(log)
    if path is None:
        raise HTTPException(404, "The workspace holds no such log.")
    return path


def _listing(workspace: Workspace) -> Listing:
    logs = []
    for entry in workspace.index.entries():
        shown = kept_overview(workspace, entry.id)
        told: dict[str, Any] = {}
        if shown is not None:
            swept = [b for b in shown.blocks if b.kind in ("sid", "chirp", "sweep", "autotune")]
            told = {
                "vehicle": shown.vehicle,
                "firmware": shown.firmware,
                "duration_s": shown.duration_s,
                "sweeps": len(swept),
                "light": shown.light,
            }
        changed = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.mtime_ns / 1e9))
        logs.append(
            LogItem(
                id=entry.id,
                name=Path(entry.path).name,
                path=entry.path,
                size=entry.size,
                changed=changed,
                **told,
            )
        )
    left = [LeftOut(path=path, reason=why) for path, why in workspace.left_out.items()]
    folder = shown_name(workspace.folder)
    return Listing(folder=folder, version=VERSION, logs=logs, left_out=left)


def _add_jobs(app: FastAPI, workspace: Workspace, workers: Workers) -> None:
    @app.get("/api/jobs")
    async def jobs() -> list[Job]:
        return workers.all()

    @app.post("/api/jobs")
    async def again(job: Job) -> list[Job]:
        workers.ensure(job.kind, job.log, _known(workspace, job.log), again=True)
        return workers.all()

    @app.delete("/api/jobs/{name}")
    async def cancel(name: str) -> list[Job]:
        if not workers.cancel(name):
            raise HTTPException(404, "There is no such job that runs.")
        return workers.all()


def _add_studies(app: FastAPI, studies: Studies) -> None:
    @app.get("/api/studies/{log}")
    async def study(log: Log, response: Response) -> StudyText | None:
        found = await asyncio.to_thread(studies.read, log)
        return None if found is None else _tagged(found, response)

    @app.patch("/api/studies/{log}")
    async def change(
        log: Log, edits: Edits, response: Response, if_match: Annotated[str | None, Header()] = None
    ) -> StudyText:
        return await _stored(studies.change, log, edits, if_match, response)

    @app.post("/api/studies/{log}")
    async def replace(
        log: Log,
        whole: WholeText,
        response: Response,
        if_match: Annotated[str | None, Header()] = None,
    ) -> StudyText:
        return await _stored(studies.replace, log, whole, if_match, response)


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
