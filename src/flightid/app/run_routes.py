"""Answers about a study that is run whole: its state, pictures, report, everything as a zip."""

from __future__ import annotations

import asyncio
import json
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from fastapi import FastAPI, HTTPException, Response
from fastapi.responses import StreamingResponse

from flightid.app.backstage import Backstage, LogName
from flightid.app.guard import REPORT_POLICY
from flightid.app.kept_parts import kept_part
from flightid.app.own_folders import is_link, read_plain, shown_name
from flightid.app.run_schemas import RunPart, RunScreen
from flightid.app.run_work import FIGURES
from flightid.app.study_reach import named_places, require_inside
from flightid.app.workspace import Workspace
from flightid.errors import FlightidError
from flightid.plot.graph_objects import plotting_library
from flightid.study.output import WRITTEN

CHUNK = 1 << 16
ELSEWHERE = "The study names files outside the folder of the page, or missing ones:"


def add_run_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what screens of results ask."""
    workspace, workers = backstage.workspace, backstage.workers

    def kept(log: str) -> tuple[RunPart, Path]:
        """The last run, and its folder; 404 where there is none."""
        found = kept_part(workspace, log, "run")
        if not isinstance(found, RunPart):
            raise HTTPException(404, "This study was not run yet.")
        folder = workspace.result_path(log, "run.json").parent / found.folder
        if is_link(folder) or not folder.is_dir() or not (folder / WRITTEN).is_file():
            raise HTTPException(404, "What the run wrote is gone; run the study again.")
        return found, folder

    @app.get("/api/runs/{log}")
    async def screen(log: LogName) -> RunScreen:
        found = await asyncio.to_thread(kept_part, workspace, log, "run")
        jobs = [job for job in workers.of_log(log) if job.kind == "run"]
        left = await asyncio.to_thread(_left_out, workspace, log)
        part = found if isinstance(found, RunPart) else None
        return RunScreen(run=part, jobs=jobs, left_out=left)

    @app.post("/api/runs/{log}")
    async def run(log: LogName) -> RunScreen:
        path = backstage.studies.path(log)
        if path is None:
            raise HTTPException(404, "There is no study to run.")
        backstage.studies.opened(log)  # refuses a link before a run follows it
        await asyncio.to_thread(require_inside, workspace.folder, path)
        workers.ensure("run", log, path, again=True)
        return await screen(log)

    @app.get("/api/runs/{log}/figures/{number}")
    async def figure(log: LogName, number: int) -> Response:
        found, folder = kept(log)
        text = await asyncio.to_thread(read_plain, folder.with_name(f"{folder.name}-{FIGURES}"))
        if not 0 <= number < found.figures:
            raise HTTPException(404, "There is no such picture.")
        try:
            spec = json.dumps(json.loads(text)[number], allow_nan=False)
        except (ValueError, TypeError, LookupError, RecursionError) as error:
            raise HTTPException(404, "This picture is broken; run the study again.") from error
        return Response(spec, media_type="application/json")

    @app.get("/api/runs/{log}/report")
    async def report(log: LogName) -> Response:
        _, folder = kept(log)
        text = await asyncio.to_thread(read_plain, folder / "report.html")
        headers = {"content-security-policy": REPORT_POLICY}
        return Response(text, media_type="text/html; charset=utf-8", headers=headers)

    @app.get("/api/runs/{log}/zip")
    async def everything(log: LogName) -> StreamingResponse:
        _, folder = kept(log)
        backstage.studies.opened(log)
        packed = await asyncio.to_thread(_packed, backstage, log, folder)
        headers = {"content-disposition": f'attachment; filename="flightid-{log}.zip"'}
        return StreamingResponse(_pieces(packed), media_type="application/zip", headers=headers)

    @app.get("/plotly.js")
    async def plotly() -> Response:
        text = await asyncio.to_thread(plotting_library)
        return Response(text, media_type="text/javascript; charset=utf-8")


def _left_out(workspace: Workspace, log: str) -> list[str]:
    """Files that a zip cannot hold; none where the study is not there, or cannot be read."""
    study = workspace.study_path(log)
    if is_link(study) or not study.is_file():
        return []
    try:
        return [shown_name(path) for path in _named_files(workspace, study)[1]]
    except (FlightidError, OSError):
        return []


def _named_files(workspace: Workspace, study: Path) -> tuple[list[Path], list[Path]]:
    """Files that a study names: those in the folder of the page, and those elsewhere or missing."""
    held: list[Path] = []
    elsewhere: list[Path] = []
    for place in named_places(study):
        inside = place.is_file() and place.is_relative_to(workspace.folder)
        (held if inside else elsewhere).append(place)
    return held, elsewhere


def _packed(backstage: Backstage, log: str, folder: Path) -> IO[bytes]:
    """Study, data and results under the paths of the workspace, so that the study runs again."""
    workspace, study = backstage.workspace, backstage.workspace.study_path(log)
    named, elsewhere = _named_files(workspace, study)
    packed = tempfile.TemporaryFile()  # noqa: SIM115 - closed when it has been sent
    # Stamps before 1980 have no place in a zip: the nearest is taken.
    deflated = zipfile.ZIP_DEFLATED
    with zipfile.ZipFile(packed, "w", deflated, strict_timestamps=False) as archive:
        for path in dict.fromkeys([study, *named]):
            archive.write(path, shown_name(path.relative_to(workspace.folder).as_posix()))
        if elsewhere:
            names = "".join(f"{shown_name(path)}\n" for path in elsewhere)
            archive.writestr("NOT_IN_HERE.txt", f"{ELSEWHERE}\n{names}")
        for path in sorted(each for each in folder.rglob("*") if each.is_file()):
            if not is_link(path):
                name = shown_name(path.relative_to(folder).as_posix())
                archive.write(path, f"studies/{log}-output/{name}")
    packed.seek(0)
    return packed


def _pieces(packed: IO[bytes]) -> Iterator[bytes]:
    with packed:
        while piece := packed.read(CHUNK):
            yield piece
