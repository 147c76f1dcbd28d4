"""What page and server tell each other of fleets; instants are s since 1970, UTC."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from flightid.app.schemas import Job, Message, ShownFinding

FleetCell = str | int | float | bool | None
MOST_SQL = 20_000


class FleetItem(Message):
    """A fleet file or a catalogue of the workspace."""

    id: str
    path: str
    is_file: bool


class LogFolder(Message):
    """A folder of logs of which a fleet can be made."""

    name: str
    logs: int


class FleetListing(Message):
    """All fleets, and folders that could be one."""

    fleets: list[FleetItem]
    folders: list[LogFolder]


class FleetStart(Message):
    """A folder right below the workspace, as `flightid fleet run FOLDER` takes it."""

    folder: str = Field(min_length=1, max_length=300)


class FleetDraft(Message):
    """The fleet file that was written, and what was chosen."""

    fleet: FleetItem
    said: list[str]


class FleetSheet(Message):
    """Rows as they are shown."""

    title: str
    columns: list[str]
    units: list[str]
    digits: list[int]
    rows: list[list[FleetCell]]
    notes: list[str]


class FleetHistory(Message):
    """A parameter of a vehicle over time, with the level behind it and when it changed."""

    vehicle: str
    type: str
    model: str
    name: str
    unit: str
    label: str
    time_s: list[float]
    values: list[float]
    half: list[float]
    level: list[float]
    low: list[float]
    high: list[float]
    changed: bool
    kind: str
    words: str
    changed_s: tuple[float, float] | None
    events: list[tuple[float, str]]
    logs: list[str]


class FleetHappening(Message):
    """Something that was done to a vehicle, or to all (null)."""

    date: str = Field(min_length=4, max_length=40)
    what: str = Field(min_length=1, max_length=200)
    vehicle: str | None = Field(default=None, max_length=300)


class FleetVehicle(Message):
    """A vehicle with its light."""

    name: str
    types: list[str]
    flights: int
    finding: ShownFinding


class FleetType(Message):
    """What is known of one model of one type."""

    name: str
    model: str
    reasons: list[str]
    labels: dict[str, str]
    tables: list[FleetSheet]
    notes: list[str]
    findings: list[ShownFinding]


class FleetPart(Message):
    """The answers of a fleet, as its report gives them."""

    title: str
    words: str
    verdict: str
    level: float
    vehicles: list[FleetVehicle]
    types: list[FleetType]
    histories: list[FleetHistory]
    refused: FleetSheet
    undated: int


class FleetRunPart(Message):
    """What the last run of a fleet from the page did."""

    lines: list[str]
    said: list[ShownFinding]


class FleetScreen(Message):
    """A fleet: its file, how far it is, and its jobs."""

    fleet: FleetItem
    text: str
    events: list[FleetHappening]
    outcomes: dict[str, int]
    found: int | None
    words: str
    run: FleetRunPart | None
    jobs: list[Job]


class FleetFlight(Message):
    """A flight of a vehicle; `here` is its log in the workspace, where the page has it."""

    log: str
    flown_at: str
    light: str
    address: str
    outcome: str
    here: str | None


class FleetVehiclePart(Message):
    """One vehicle: its flights and the histories of its parameters."""

    name: str
    flights: list[FleetFlight]
    histories: list[FleetHistory]


class FleetQuery(Message):
    """One SELECT."""

    sql: Annotated[str, Field(min_length=1, max_length=MOST_SQL)]


class FleetRows(Message):
    """Its answer, whole; `seconds` are of the worker."""

    columns: list[str]
    rows: list[list[FleetCell]]
    seconds: float
