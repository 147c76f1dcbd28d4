"""Answers of the screen Fleet: which there are, one of them, a vehicle, a question, a run."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

from fastapi import FastAPI, HTTPException, Query

from flightid.app import fleet_work
from flightid.app.backstage import Backstage, made
from flightid.app.fleet_schemas import (
    FleetDraft,
    FleetHappening,
    FleetItem,
    FleetListing,
    FleetPart,
    FleetQuery,
    FleetRows,
    FleetRunPart,
    FleetScreen,
    FleetStart,
    FleetVehiclePart,
    LogFolder,
)
from flightid.app.fleets import (
    FILE_BYTES,
    FleetPlace,
    checked_fleet,
    fleet_of,
    known_fleets,
    log_folders,
)
from flightid.app.kept_parts import kept_part
from flightid.app.own_folders import read_plain
from flightid.app.workspace import Workspace
from flightid.errors import FlightidError
from flightid.fleet import fleet_status
from flightid.fleet.event_entry import add_event
from flightid.fleet.opening import has_catalogue
from flightid.fleet.settings import EventSettings, FleetSettings


def add_fleet_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the screen Fleet asks."""
    workspace, workers = backstage.workspace, backstage.workers

    async def sound(fleet: str) -> FleetPlace:
        return await asyncio.to_thread(sound_fleet, workspace, fleet)

    @app.get("/api/fleets")
    async def listing() -> FleetListing:
        await asyncio.to_thread(workspace.scan)
        return await asyncio.to_thread(_listing, workspace)

    @app.post("/api/fleets")
    async def propose(asked: FleetStart) -> FleetDraft:
        if asked.folder not in log_folders(workspace):
            raise HTTPException(404, "There is no such folder of logs right below the workspace.")
        work = (fleet_work.propose, workspace.folder / asked.folder)
        name, said = await made(workers.asked(*work))
        found = next((each for each in known_fleets(workspace) if each.shown == name), None)
        if found is None:
            raise HTTPException(
                422, f"{name} is written, but there are too many fleets to list it."
            )
        return FleetDraft(fleet=_item(found), said=said)

    @app.get("/api/fleets/{fleet}")
    async def screen(fleet: str) -> FleetScreen:
        return await asyncio.to_thread(_screen, backstage, known_fleet(workspace, fleet))

    @app.get("/api/fleets/{fleet}/answers")
    async def answers(fleet: str) -> FleetPart:
        place = await sound(fleet)
        return FleetPart(**await made(workers.asked(fleet_work.answer_fleet, place.path)))

    @app.get("/api/fleets/{fleet}/vehicle")
    async def vehicle(fleet: str, name: Annotated[str, Query(max_length=300)]) -> FleetVehiclePart:
        place = await sound(fleet)
        work = (fleet_work.answer_vehicle, place.path, name)
        part = FleetVehiclePart(**await made(workers.asked(*work)))
        for each in part.flights:
            here = each.log[:16]
            each.here = here if workspace.log_path(here) is not None else None
        return part

    @app.post("/api/fleets/{fleet}/query")
    async def query(fleet: str, asked: FleetQuery) -> FleetRows:
        place = await sound(fleet)
        told, refusal, seconds = await workers.questioned(
            fleet_work.query_fleet, place.path, asked.sql
        )
        if refusal:
            raise HTTPException(422, refusal)
        return FleetRows(**told, seconds=seconds)

    @app.post("/api/fleets/{fleet}/events")
    async def happened(fleet: str, asked: FleetHappening) -> FleetScreen:
        place = await sound(fleet)
        if not place.is_file:
            raise HTTPException(422, "A catalogue alone has no events; its fleet file has.")
        event = EventSettings(asked.date, asked.what, asked.vehicle)
        await asyncio.to_thread(add_event, place.path, event)
        return await screen(fleet)

    @app.post("/api/fleets/{fleet}/run")
    async def run(fleet: str) -> FleetScreen:
        place = await sound(fleet)
        if not place.is_file:
            raise HTTPException(422, "A catalogue alone cannot be run; its fleet file can.")
        workers.ensure("fleet", fleet, place.path, again=True)
        return await screen(fleet)


def known_fleet(workspace: Workspace, fleet: str) -> FleetPlace:
    """A fleet by its id; 404 where the workspace holds no such one."""
    place = fleet_of(workspace, fleet)
    if place is None:
        raise HTTPException(404, "The workspace holds no such fleet.")
    return place


def sound_fleet(workspace: Workspace, fleet: str) -> FleetPlace:
    """The same, all of which lies in the workspace.

    Raises
    ------
    FlightidError
        As `checked_fleet`.
    """
    place = known_fleet(workspace, fleet)
    checked_fleet(workspace, place)
    return place


def _listing(workspace: Workspace) -> FleetListing:
    folders = log_folders(workspace)
    return FleetListing(
        fleets=[_item(each) for each in known_fleets(workspace)],
        folders=[LogFolder(name=name, logs=number) for name, number in folders.items()],
    )


def _item(place: FleetPlace) -> FleetItem:
    return FleetItem(id=place.id, path=place.shown, is_file=place.is_file)


def _screen(backstage: Backstage, place: FleetPlace) -> FleetScreen:
    workspace = backstage.workspace
    outcomes: dict[str, int] = {}
    found, words, events = None, "", list[FleetHappening]()
    try:
        settings = checked_fleet(workspace, place)
        events = _events(settings)
        # A fleet that was never run has nothing to count, which is no fault.
        if settings is None or has_catalogue(settings.catalogue):
            status = fleet_status(place.path)
            outcomes, found = dict(status.outcomes), status.found
    except (FlightidError, OSError) as error:
        words = str(error)
    part = kept_part(workspace, place.id, "fleet")
    return FleetScreen(
        fleet=_item(place),
        text=_text(place.path) if place.is_file else "",
        events=events,
        outcomes=outcomes,
        found=found,
        words=words,
        run=part if isinstance(part, FleetRunPart) else None,
        jobs=[job for job in backstage.workers.of_log(place.id) if job.kind == "fleet"],
    )


def _events(settings: FleetSettings | None) -> list[FleetHappening]:
    """What was done, the newest first."""
    found = sorted(() if settings is None else settings.events, key=lambda each: each.instant)
    return [
        FleetHappening.model_construct(date=each.date, what=each.what, vehicle=each.vehicle)
        for each in reversed(found)
    ]


def _text(path: Path) -> str:
    return read_plain(path, FILE_BYTES).decode("utf-8", "replace")
