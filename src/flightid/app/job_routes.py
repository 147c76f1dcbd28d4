"""Answers about jobs: which run, begin one again, end one."""

from __future__ import annotations

import asyncio

from fastapi import FastAPI, HTTPException

from flightid.app.backstage import Backstage, known_log
from flightid.app.fleet_routes import sound_fleet
from flightid.app.gain_answers import kept_gains
from flightid.app.schemas import Job


def add_job_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the head of the page asks."""
    workspace, workers = backstage.workspace, backstage.workers

    @app.get("/api/jobs")
    async def jobs() -> list[Job]:
        return workers.all()

    @app.post("/api/jobs")
    async def again(job: Job) -> list[Job]:
        of_study = job.kind in ("run", "gains")
        path, version = backstage.studies.path(job.log) if of_study else None, ""
        if job.kind == "proposal":
            raise HTTPException(422, "Ask for the study of these records again.")
        if job.kind == "fleet":
            path = (await asyncio.to_thread(sound_fleet, workspace, job.log)).path
        if of_study and path is None:
            raise HTTPException(404, "There is no study to run.")
        if job.kind == "gains":
            _, version, _ = await asyncio.to_thread(kept_gains, backstage, job.log)
        path = path or known_log(workspace, job.log)
        workers.ensure(job.kind, job.log, path, again=True, of=version)
        return workers.all()

    @app.delete("/api/jobs/{name}")
    async def cancel(name: str) -> list[Job]:
        if not workers.cancel(name):
            raise HTTPException(404, "There is no such job that runs.")
        return workers.all()
