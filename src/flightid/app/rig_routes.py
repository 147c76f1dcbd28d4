"""Answers about records of a rig: which there are, what is in them, a view, their study."""

from __future__ import annotations

import asyncio
import hashlib
import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import FastAPI, HTTPException, Query, Request, Response
from numpy.typing import NDArray

from flightid.app import rig_work
from flightid.app.backstage import Backstage, LogName, made
from flightid.app.bare_study import UNWRITTEN
from flightid.app.field_routes import MOST_COLUMNS
from flightid.app.guard import UPLOAD_BYTES
from flightid.app.own_folders import is_link
from flightid.app.pyramid import Pyramid, view
from flightid.app.removed import RemovedList
from flightid.app.rig_schemas import (
    ProposedStudy,
    RigFileRequest,
    RigItem,
    RigProposal,
    RigReading,
    RigScreen,
)
from flightid.app.rigs import Rigs
from flightid.app.schemas import WholeText
from flightid.models import library_names

ROLES = {"inputs", "outputs", "excitations", "model", "actuators", "conditioning"}
"""What a proposal is asked beside how its files are read."""
MOST_CHANNELS = 128
"""In one view: as many inputs and outputs as a study of records may be asked for."""


def add_rig_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the screen of records asks."""
    workspace, workers = backstage.workspace, backstage.workers
    rigs, removed = Rigs(workspace), RemovedList(workspace)

    @app.get("/api/records")
    async def listing() -> list[RigItem]:
        known, left = await asyncio.to_thread(rigs.ids), removed.ids()
        return [_item(rigs, backstage, each) for each in known if each not in left]

    @app.put("/api/records")
    async def upload(
        request: Request,
        name: Annotated[str, Query(max_length=300)],
        rig: Annotated[str, Query(max_length=16)] = "",
    ) -> RigItem:
        if int(request.headers.get("content-length", 0)) > UPLOAD_BYTES:
            raise HTTPException(413)

        async def check(path: Path) -> str:
            return (await workers.live(rig_work.require_table, path))[1]

        taken = await rigs.take(name, request.stream(), rig, check=check)
        await asyncio.to_thread(removed.put_back, taken)
        return _item(rigs, backstage, taken)

    @app.get("/api/records/{rig}")
    async def screen(rig: LogName, reading: Annotated[RigReading, Query()]) -> RigScreen:
        paths = _known(rigs, rig)
        told = await made(workers.live(rig_work.make_rig, paths, _options(reading)))
        left = [each.name for each in rigs.all_files(rig) if each not in paths]
        return RigScreen(id=rig, jobs=workers.of_log(rig), left_out=left, **told)

    @app.post("/api/records/{rig}/files")
    async def leave_out(rig: LogName, asked: RigFileRequest) -> RigItem:
        """Take a file out of a set, which keeps one at least, or put it back."""
        kept = [each.name for each in _known(rigs, rig)]
        if asked.name not in [each.name for each in rigs.all_files(rig)]:
            raise HTTPException(404, "The records hold no such file.")
        if asked.out and kept == [asked.name]:
            raise HTTPException(422, "This is the last file: remove the records from the list.")
        await asyncio.to_thread(removed.leave_out, rig, asked.name, out=asked.out)
        return _item(rigs, backstage, rig)

    @app.post("/api/records/{rig}/study")
    async def propose(rig: LogName, asked: RigProposal) -> ProposedStudy:
        return await _proposed(backstage, rig, asked)

    @app.get("/api/records/{rig}/view", response_class=Response)
    async def seen(
        rig: LogName,
        file: Annotated[str, Query(max_length=300)],
        manoeuvre: Annotated[str, Query(max_length=300)],
        series: Annotated[list[str], Query(min_length=1, max_length=MOST_CHANNELS)],
        start_s: float,
        stop_s: float,
        columns: Annotated[int, Query(ge=10, le=MOST_COLUMNS)],
        time_column: Annotated[str | None, Query(max_length=300)] = None,
        sample_time_s: Annotated[float | None, Query(gt=0.0)] = None,
        resample_to_s: Annotated[float | None, Query(gt=0.0)] = None,
        hold: Annotated[Literal["zero", "first", "band_limited"] | None, Query()] = None,
        inputs: Annotated[tuple[str, ...], Query(max_length=MOST_CHANNELS)] = (),
    ) -> Response:
        _require_span(start_s, stop_s)
        path = _file(rigs, rig, file)
        told: dict[str, Any] = {"time_column": time_column, "sample_time_s": sample_time_s}
        reading = RigReading(**told, resample_to_s=resample_to_s, hold=hold)
        options = await _viewed(backstage, _known(rigs, rig), file, reading, series, inputs)
        levels = [await _levels(backstage, rig, path, manoeuvre, each, options) for each in series]
        table = await asyncio.to_thread(view, levels, (start_s, stop_s), columns)
        return Response(_packed(table), media_type="application/octet-stream")


async def _proposed(backstage: Backstage, rig: str, asked: RigProposal) -> ProposedStudy:
    """What `flightid new` writes for a set; written where nothing stands."""
    workspace, workers, studies = backstage.workspace, backstage.workers, backstage.studies
    rigs = Rigs(workspace)
    paths, target = _known(rigs, rig), workspace.study_path(rig)
    if asked.model is not None and asked.model not in library_names():
        raise HTTPException(422, f"The library has no model {asked.model}.")
    if not asked.anew:
        await asyncio.to_thread(studies.require_readable, rig)
    roles = asked.model_dump(include=ROLES)
    units = asked.units_of_roles()
    reading = _options(asked) | ({"units": units} if units else {})
    # Structures are tried for as long as that takes, where it holds up no hand that drags.
    call = workers.proposed(rig, rig_work.propose, paths, target.parent, roles, reading)
    proposed = ProposedStudy(**await made(call))
    if proposed.text and studies.path(rig) is None:
        whole = WholeText(text=proposed.text)
        await asyncio.to_thread(studies.replace, rig, whole, UNWRITTEN)
    return proposed


def _require_span(start_s: float, stop_s: float) -> None:
    if not (math.isfinite(start_s) and math.isfinite(stop_s) and start_s < stop_s):
        raise HTTPException(422, "A span needs two instants, the first before the last.")


async def _viewed(
    backstage: Backstage,
    paths: list[Path],
    file: str,
    reading: RigReading,
    series: Sequence[str],
    inputs: Sequence[str],
) -> dict[str, Any]:
    """How a file of a set is read for its chart: each input in one way in all files of the set."""
    options = _options(reading) | roles_of(series, inputs, reading)
    if "inputs" not in options:
        return options
    ways = await made(backstage.workers.live(rig_work.input_ways, paths, options))
    return options | ({"interpolation": ways[file]} if file in ways else {})


async def _levels(
    backstage: Backstage,
    rig: str,
    path: Path,
    manoeuvre: str,
    channel: str,
    options: dict[str, Any],
) -> Pyramid:
    """Levels of a channel, made where they are not there yet."""
    said = repr((path.name, path.stat().st_mtime_ns, manoeuvre, channel, sorted(options.items())))
    name = hashlib.sha256(said.encode()).hexdigest()[:24]
    target = backstage.workspace.result_path(rig, f"{name}.npy").with_suffix(".npy")
    with suppress(OSError, ValueError, IndexError, EOFError):
        if not is_link(target):
            return await asyncio.to_thread(Pyramid.read, target)
    work = (rig_work.make_rig_pyramid, path, manoeuvre, channel, options, target)
    await made(backstage.workers.live(*work))
    return await asyncio.to_thread(Pyramid.read, target)


def _packed(table: NDArray[np.float64]) -> bytes:
    """Columns, rows, then the numbers row by row."""
    return np.array(table.shape[::-1], np.float64).tobytes() + table.tobytes()


def roles_of(
    series: Sequence[str], inputs: Sequence[str], reading: RigReading
) -> dict[str, list[str]]:
    """Roles of the channels of a view on another grid; all that are not inputs answer to them.

    Between the rows an input is held and an output is not: as the study reads them.
    """
    if reading.resample_to_s is None:
        return {}
    sides = {
        "inputs": [each for each in series if each in inputs],
        "outputs": [each for each in series if each not in inputs],
    }
    return {side: sorted(set(names)) for side, names in sides.items() if names}


def _options(reading: RigReading) -> dict[str, Any]:
    return reading.model_dump(include=set(RigReading.model_fields), exclude_none=True)


def _file(rigs: Rigs, rig: str, name: str) -> Path:
    for path in _known(rigs, rig):
        if path.name == name:
            return path
    raise HTTPException(404, "The records hold no such file.")


def _known(rigs: Rigs, rig: str) -> list[Path]:
    paths = rigs.files(rig)
    if not paths:
        raise HTTPException(404, "The workspace holds no such records.")
    return paths


def _item(rigs: Rigs, backstage: Backstage, rig: str) -> RigItem:
    paths = _known(rigs, rig)
    return RigItem(
        id=rig,
        name=rigs.name_of(rig),
        files=len(paths),
        size=sum(path.stat().st_size for path in paths),
        has_study=backstage.studies.path(rig) is not None,
    )
