"""Answers of the screen Fly: a socket of its own, and the flights that the workspace keeps."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from fastapi import FastAPI, HTTPException, Response, WebSocket, WebSocketDisconnect
from pydantic import Field, TypeAdapter, ValidationError

from flightid.app import rig_work
from flightid.app.backstage import Backstage, made
from flightid.app.fly_deck import FlightDeck
from flightid.app.fly_journal import (
    RECORD,
    STUDY,
    finish_flight,
    flight_folder,
    keep_rating,
    kept_flights,
)
from flightid.app.fly_schemas import (
    CooperHarperRating,
    FlownItem,
    FlownRecords,
    FlyChoice,
    FlyNews,
    FlyOrder,
    FlySettings,
    FlyStart,
    FlyStick,
    FlySweep,
    FlySwitch,
    OwnVehicles,
)
from flightid.app.fly_shelf import choice_of, make_shelf, model_files
from flightid.app.fly_text import rate_flight_study, start_of
from flightid.app.fly_vehicles import VEHICLES
from flightid.app.own_folders import is_link, read_plain
from flightid.app.removed import RemovedList
from flightid.app.rigs import Rigs
from flightid.errors import FlightidError
from flightid.reading import DOCUMENT_BYTES

FlyCommand = FlyStart | FlyStick | FlySwitch | FlySweep | FlyOrder
COMMANDS: TypeAdapter[FlyCommand] = TypeAdapter(Annotated[FlyCommand, Field(discriminator="do")])
MOST_WORDS = 1 << 12
TAKEN = "A flight is under way in another window; end it there first."
MOST_RECORD_BYTES = 256 << 20


def add_fly_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the screen Fly asks."""
    workspace = backstage.workspace.folder
    deck = FlightDeck(workspace)
    library = [choice_of(each) for each in VEHICLES]

    @app.get("/api/fly/vehicles")
    def vehicles() -> list[FlyChoice]:
        return library

    @app.get("/api/fly/own")
    async def own() -> OwnVehicles:
        # Models of a folder may be a stranger's: a worker with limits reads and tries them.
        found = await asyncio.to_thread(model_files, backstage.workspace)
        shelf = await made(backstage.workers.live(make_shelf, found))
        deck.own = {each.name: each for each in shelf.vehicles}
        return OwnVehicles(vehicles=shelf.choices, left_out=shelf.left_out)

    @app.get("/api/fly/flights")
    def flights() -> list[FlownItem]:
        flown = deck.flown()
        found = []
        for each in kept_flights(workspace):
            if each["id"] == flown:
                continue
            with suppress(ValidationError):
                if each["rating"] is not None:
                    each["rating"] = CooperHarperRating.model_validate(each["rating"])
                found.append(FlownItem(**each))
        return found

    @app.post("/api/fly/flights/{flight}/finish")
    def finish(flight: str) -> list[FlownItem]:
        folder = _known(workspace, flight)
        if deck.flown() == flight:
            raise HTTPException(409, "This flight is still flown.")
        if not (folder / RECORD).is_file():
            finish_flight(folder)
        return flights()

    @app.post("/api/fly/flights/{flight}/rating")
    def rate(flight: str, rating: CooperHarperRating) -> list[FlownItem]:
        folder = _known(workspace, flight)
        keep_rating(folder, rating.model_dump())
        rate_flight_study(folder, rating.model_dump())
        return flights()

    @app.get("/api/fly/flights/{flight}/record", response_class=Response)
    def record(flight: str) -> Response:
        content = _record_bytes(_known(workspace, flight))
        attached = {"content-disposition": f'attachment; filename="{flight}.nc"'}
        return Response(content, media_type="application/x-netcdf", headers=attached)

    @app.post("/api/fly/flights/{flight}/records")
    async def shelve(flight: str) -> FlownRecords:
        """Its record among those of rigs, as if it had been dropped; once more, it is the same."""
        folder = await asyncio.to_thread(_known, workspace, flight)

        async def check(path: Path) -> str:
            return (await backstage.workers.live(rig_work.require_table, path))[1]

        async def pieces() -> AsyncIterator[bytes]:
            yield await asyncio.to_thread(_record_bytes, folder)

        taken = await Rigs(backstage.workspace).take(f"{flight}.nc", pieces(), check=check)
        await asyncio.to_thread(RemovedList(backstage.workspace).put_back, taken)
        return FlownRecords(id=taken)

    _add_studies(app, deck, workspace)
    _add_socket(app, deck)


def _add_studies(app: FastAPI, deck: FlightDeck, workspace: Path) -> None:
    @app.get("/api/fly/flights/{flight}/study", response_class=Response)
    def study(flight: str) -> Response:
        try:
            text = read_plain(_known(workspace, flight) / STUDY, DOCUMENT_BYTES)
        except OSError as error:
            raise HTTPException(404, "This flight has no study.") from error
        attached = {"content-disposition": f'attachment; filename="{flight}.toml"'}
        return Response(text, media_type="application/toml", headers=attached)

    @app.post("/api/fly/settings")
    async def settings(asked: FlySettings) -> FlyStart:
        """What a study says of a flight, to fly it so."""
        place = workspace if asked.flight is None else _known(workspace, asked.flight)
        known = [*VEHICLES, *deck.own.values()]
        try:
            return await asyncio.to_thread(start_of, asked.text, place, known)
        except (FlightidError, ValidationError) as error:
            raise HTTPException(422, str(error)) from error


def _add_socket(app: FastAPI, deck: FlightDeck) -> None:
    @app.websocket("/api/fly")
    async def fly(socket: WebSocket) -> None:
        await socket.accept()
        if not deck.enter(socket):
            await socket.send_text(FlyNews(state="refused", words=TAKEN).model_dump_json())
            await socket.close(1013)
            return
        news = NewestFrame(asyncio.get_running_loop())
        side = asyncio.create_task(_tell(socket, news))
        try:
            news.put(FlyNews(state="ready"))
            while True:
                words = await socket.receive_text()
                if len(words) > MOST_WORDS:
                    await socket.close(1009)
                    break
                await _obey(deck, COMMANDS.validate_json(words), news)
        except ValueError:
            await socket.close(1007)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            await asyncio.to_thread(deck.leave, socket)
            side.cancel()
            with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await side


class NewestFrame:
    """News on their way: states in their order, of frames the newest alone.

    Parameters
    ----------
    loop : asyncio.AbstractEventLoop
        In which they are waited for.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop, self._there = loop, asyncio.Event()
        self._frame: FlyNews | None = None
        self._states: list[FlyNews] = []

    def put(self, news: FlyNews) -> None:
        """Tell, from any thread."""
        with suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(self._put, news)

    def _put(self, news: FlyNews) -> None:
        if news.frame is not None:
            self._frame = news
        else:
            self._states.append(news)
        self._there.set()

    async def get(self) -> list[FlyNews]:
        """What is new."""
        await self._there.wait()
        self._there.clear()
        found = [*([] if self._frame is None else [self._frame]), *self._states]
        self._frame, self._states = None, []
        return found


async def _tell(socket: WebSocket, news: NewestFrame) -> None:
    while True:
        for each in await news.get():
            await socket.send_text(each.model_dump_json(exclude_none=True))


async def _obey(deck: FlightDeck, asked: FlyCommand, news: NewestFrame) -> None:
    flight = deck.flight
    try:
        if isinstance(asked, FlyStart):
            await asyncio.to_thread(deck.start, asked, news.put)
            news.put(FlyNews(state="flying"))
        elif flight is None:
            return
        elif isinstance(asked, FlyStick):
            flight.hold(asked)
        elif isinstance(asked, FlySwitch):
            flight.switch(asked)
        elif isinstance(asked, FlySweep):
            flight.sweep(asked)
        elif asked.do == "pause":
            flight.clock.stop()
            news.put(FlyNews(state="paused"))
        elif asked.do == "resume":
            flight.clock.start()
            news.put(FlyNews(state="flying"))
        else:
            await asyncio.to_thread(deck.stop)
    except (FlightidError, OSError) as error:
        news.put(FlyNews(state="refused", words=str(error)))


def _record_bytes(folder: Path) -> bytes:
    path = folder / RECORD
    if is_link(path) or not path.is_file() or path.stat().st_size > MOST_RECORD_BYTES:
        raise HTTPException(404, "This flight has no record.")
    return path.read_bytes()


def _known(workspace: Path, flight: str) -> Path:
    if not any(each["id"] == flight for each in kept_flights(workspace)):
        raise HTTPException(404, "The workspace holds no such flight.")
    return flight_folder(workspace, flight)
