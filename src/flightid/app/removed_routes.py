"""Answers about what was taken off the list: which it is, take something off, put it back."""

from __future__ import annotations

import asyncio
from pathlib import Path

from fastapi import FastAPI, HTTPException

from flightid.app.backstage import Backstage
from flightid.app.removed import RemovedList
from flightid.app.rigs import Rigs
from flightid.app.schemas import RemovalRequest, RemovedItem


def add_removed_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the list of logs and records asks of those that it leaves out."""
    removed, rigs = RemovedList(backstage.workspace), Rigs(backstage.workspace)

    def found(item: str) -> RemovedItem | None:
        """A log or records that the folder still holds, by the id."""
        if (log := backstage.workspace.log_path(item)) is not None:
            place = log.relative_to(backstage.workspace.folder).as_posix()
            return RemovedItem(id=item, kind="log", name=log.name, path=place)
        files: list[Path] = rigs.files(item)
        if not files:
            return None
        name = rigs.name_of(item)
        return RemovedItem(id=item, kind="records", name=name, path=f"records/{item}")

    def listed() -> list[RemovedItem]:
        return [each for each in map(found, removed.ids()) if each is not None]

    @app.get("/api/removed")
    async def listing() -> list[RemovedItem]:
        return await asyncio.to_thread(listed)

    @app.post("/api/removed")
    async def change(asked: RemovalRequest) -> list[RemovedItem]:
        if await asyncio.to_thread(found, asked.id) is None:
            raise HTTPException(404, "The workspace holds no such log and no such records.")
        await asyncio.to_thread(removed.take_off if asked.removed else removed.put_back, asked.id)
        return await asyncio.to_thread(listed)
