"""Answers about logs: the listing of the workspace, an upload, what is known of one."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from fastapi import FastAPI, HTTPException, Query, Request

from flightid.app import rig_work
from flightid.app.backstage import Backstage, LogName, known_log, made
from flightid.app.guard import UPLOAD_BYTES
from flightid.app.kept_parts import kept_overview, kept_review
from flightid.app.own_folders import shown_name
from flightid.app.removed import RemovedList
from flightid.app.rig_schemas import ProposedStudy
from flightid.app.schemas import FlightScreen, LeftOut, Listing, LogItem
from flightid.app.workspace import UNDATED_NS, Workspace
from flightid.findings import unsaid
from flightid.version import VERSION

MOST_LOOKED_AT = 200
"""Logs that a listing has inspected, one after the other; others when they are opened."""
LATEST_MS = 253_370_764_800_000
"""First instant of the year 9999: no file is younger."""
LAST_DATE = "9999"
OF_FLIGHT = ("overview", "review")
"""Jobs that the screen of a flight needs."""


def add_log_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the screens Logs and Flight ask."""
    workspace, workers = backstage.workspace, backstage.workers
    removed = RemovedList(workspace)

    @app.get("/api/workspace")
    async def listing() -> Listing:
        await asyncio.to_thread(workspace.scan)
        listed = await asyncio.to_thread(_listing, workspace, removed.ids())
        for each in [log for log in listed.logs if log.light is None][:MOST_LOOKED_AT]:
            if (path := workspace.log_path(each.id)) is not None:
                workers.ensure("overview", each.id, path)
        return listed

    @app.put("/api/logs")
    async def upload(
        request: Request,
        name: Annotated[str, Query(max_length=300)],
        modified_ms: Annotated[int, Query(ge=0, le=LATEST_MS)] = 0,
    ) -> LogItem:
        length = int(request.headers.get("content-length", 0))
        if length > UPLOAD_BYTES:
            raise HTTPException(413)
        log = await workspace.take(name, request.stream(), modified_ms)
        await asyncio.to_thread(removed.put_back, log)
        path = known_log(workspace, log)
        workers.ensure("overview", log, path)
        return next(each for each in _listing(workspace).logs if each.id == log)

    @app.get("/api/logs/{log}")
    async def flight(log: LogName) -> FlightScreen:
        path = known_log(workspace, log)
        for kind in OF_FLIGHT:
            workers.ensure(kind, log, path)
        overview, review = kept_overview(workspace, log), kept_review(workspace, log)
        if overview is not None and review is not None:
            # Both look at one log: what the first says the second does not repeat.
            alone = unsaid(review.verdicts, overview.verdicts)
            review = review.model_copy(update={"verdicts": alone})
        return FlightScreen(
            id=log,
            name=path.name,
            path=path.relative_to(workspace.folder).as_posix(),
            overview=overview,
            review=review,
            jobs=workers.of_log(log),
        )

    @app.post("/api/logs/{log}/study")
    async def propose(log: LogName) -> ProposedStudy:
        """The study that `flightid new` writes for a log, to take the place of one that is lost."""
        path, folder = known_log(workspace, log), workspace.study_path(log).parent
        call = workers.proposed(log, rig_work.propose, [path], folder, {}, {})
        return ProposedStudy(**await made(call))


def _folder_words(folder: Path) -> str:
    """A folder as a shell names it: from the home, where it lies there."""
    try:
        return shown_name(Path("~") / folder.relative_to(Path.home()))
    except (RuntimeError, ValueError):  # no home, or elsewhere
        return shown_name(folder)


def _listing(workspace: Workspace, removed: Sequence[str] = ()) -> Listing:
    logs = []
    for entry in workspace.index.entries():
        if entry.id in removed:
            continue
        shown = kept_overview(workspace, entry.id)
        told: dict[str, Any] = {}
        if shown is not None:
            swept = [b for b in shown.blocks if b.kind in ("sid", "chirp", "sweep", "autotune")]
            told = {
                "vehicle": shown.vehicle,
                "firmware": shown.firmware,
                "flown": shown.flown,
                "duration_s": shown.duration_s,
                "sweeps": len(swept),
                "light": shown.light,
            }
        known = entry.mtime_ns > UNDATED_NS
        changed = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.mtime_ns / 1e9))
        logs.append(
            LogItem(
                id=entry.id,
                name=Path(entry.path).name,
                path=entry.path,
                size=entry.size,
                changed=changed if known else "",
                **told,
            )
        )
    # What has no date at all was dropped, most of it just now.
    logs.sort(key=lambda each: each.flown or each.changed or LAST_DATE, reverse=True)
    left = [LeftOut(path=path, reason=why) for path, why in workspace.left_out.items()]
    return Listing(
        folder=_folder_words(workspace.folder), version=VERSION, logs=logs, left_out=left
    )
