"""What the answers of the page stand on, handed to every module of routes."""

from __future__ import annotations

from collections.abc import Awaitable
from pathlib import Path
from typing import Annotated, Any

from fastapi import HTTPException

from flightid.app.jobs import Workers
from flightid.app.studies import Studies
from flightid.app.workspace import Workspace
from flightid.frozen import dataclass

LogName = Annotated[str, "first 16 digits of the SHA-256 of its bytes"]


@dataclass(frozen=True)
class Backstage:
    """The folder, its studies, and the processes that work on them."""

    workspace: Workspace
    studies: Studies
    workers: Workers


def known_log(workspace: Workspace, log: str) -> Path:
    """Path of a log of the workspace; 404 where it holds none such."""
    path = workspace.log_path(log)
    if path is None:
        raise HTTPException(404, "The workspace holds no such log.")
    return path


async def made(work_done: Awaitable[tuple[Any, str, float]]) -> Any:  # noqa: ANN401 - of any work
    """What a worker has made of a hand's request; its refusal is a 422."""
    value, refusal, _ = await work_done
    if refusal:
        raise HTTPException(422, refusal)
    return value
