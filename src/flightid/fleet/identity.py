"""Who flew, when, and under which circumstances: from the log, its place, or tables beside it."""

from __future__ import annotations

import csv
import datetime
import hashlib
import re
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path, PurePosixPath

from flightid.errors import StudyError
from flightid.fleet.settings import FleetSettings, VehicleRules, instant_of
from flightid.frozen import dataclass
from flightid.logs import Log
from flightid.logs.first_fix import log_start
from flightid.reading import DOCUMENT_BYTES

SERIAL = "BRD_SERIAL_NUM"
DATES = re.compile(r"(20\d\d)[-_]?(0[1-9]|1[0-2])[-_]?(0[1-9]|[12]\d|3[01])")
OWN = {"id", "vehicle", "type", "log", "flown_at"}
TABLE_CELLS = 20_000_000
"""Of a table: what a line lacks counts, for its reader fills it in."""


@dataclass(frozen=True)
class FleetTables:
    """What tables beside the fleet file say, by id of the vehicle and by file name of the log.

    Attributes
    ----------
    vehicles, flights : mapping of str to mapping of str to str
    """

    vehicles: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    flights: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def of(self, vehicle: str | None, address: str) -> tuple[dict[str, str], dict[str, str]]:
        """Lines of a vehicle and of a flight; empty where a table has none."""
        name = PurePosixPath(address).name
        return dict(self.vehicles.get(vehicle or "", {})), dict(self.flights.get(name, {}))

    def told(self, vehicle: str | None, address: str) -> str:
        """Digest of both lines: where it changes, the log is taken again."""
        lines = [sorted(line.items()) for line in self.of(vehicle, address)]
        return hashlib.sha256(repr(lines).encode()).hexdigest()[:16] if any(lines) else ""


@dataclass(frozen=True)
class LogIdentity:
    """Who flew a log and when.

    Attributes
    ----------
    vehicle, type : str or None
    flown_at : datetime or None
        UTC, without zone.
    flown_at_from : str or None
        ``"table"``, ``"log"``, ``"name"`` or ``"file"``.
    covariates : mapping of str to str
        Other columns of the tables.
    own : str or None
        Id as the rules tell it, before a table gave it a name.
    told : str
        Digest of what the tables say; empty where they say nothing.
    """

    vehicle: str | None
    type: str | None
    flown_at: datetime.datetime | None
    flown_at_from: str | None
    covariates: Mapping[str, str] = field(default_factory=dict)
    own: str | None = None
    told: str = ""


def read_tables(settings: FleetSettings) -> FleetTables:
    """Tables of vehicles and flights that the fleet file names.

    Raises
    ------
    StudyError
        A table lacks its first column, names a line twice, or holds a date that is none.
    """
    folder, rules = settings.path.parent, settings.vehicles
    vehicles = _table(folder, rules.table, "id")
    flights = _table(folder, rules.flight_table, "log")
    for name, row in flights.items():
        if row.get("flown_at"):
            try:
                instant_of(row["flown_at"])
            except ValueError as error:
                told = _repeated(settings.path.parent, rules.flight_table, repr(row["flown_at"]))
                raise StudyError(
                    f"{rules.flight_table}: flown_at of a line has no meaning",
                    found=f"{name}: {told}" if told else None,
                    needed="a day or an instant, such as 2026-03-01T09:30",
                ) from error
    return FleetTables(vehicles, flights)


def _table(folder: Path, name: str | None, key: str) -> dict[str, dict[str, str]]:
    """Lines of a CSV by one of its columns."""
    if name is None:
        return {}
    path = folder / name
    if path.stat().st_size > 256 * DOCUMENT_BYTES:
        raise StudyError(f"{name} is too long for a table of a fleet", needed="at most 256 MiB")
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        try:
            return _lines(csv.DictReader(stream), folder, name, key)
        except csv.Error as error:
            raise StudyError(f"{name} is no table of a fleet", found=str(error)) from error


def _repeated(folder: Path, name: str | None, text: str) -> str | None:
    """What an error may repeat of a table; None of one that lies outside the fleet file's folder.

    A fleet file may come from a stranger, and name what is not theirs to read.
    """
    inside = (folder / (name or "")).resolve().is_relative_to(folder.resolve())
    return text if inside else None


def _lines(
    reader: csv.DictReader[str], folder: Path, name: str, key: str
) -> dict[str, dict[str, str]]:
    found = dict[str, dict[str, str]]()
    columns = reader.fieldnames or ()
    if key not in columns:
        raise StudyError(
            f"{name}: its first line names no column {key!r}",
            found=_repeated(folder, name, ", ".join(columns)[:200] or "nothing"),
        )
    for n, row in enumerate(reader):
        if n * len(columns) > TABLE_CELLS:
            raise StudyError(
                f"{name} is too long for a table of a fleet",
                needed=f"at most {TABLE_CELLS:,} cells, of lines that lack some too",
            )
        own = row.pop(key) or ""
        if own in found:
            told = _repeated(folder, name, own)
            raise StudyError(f"{name}: two lines have one {key}", found=told)
        found[own] = {column: text for column, text in row.items() if column and text}
    return found


@dataclass(frozen=True)
class LogWitness:
    """What a log itself says of who flew it and when; nothing where it cannot be read.

    Attributes
    ----------
    own : str or None
        Id, where the rules look for it in the log.
    type : str or None
    started : datetime or None
        By the first fix with a date, UTC.
    """

    own: str | None = None
    type: str | None = None
    started: datetime.datetime | None = None

    @classmethod
    def of(cls, log: Log | None, rules: VehicleRules) -> LogWitness:
        """Of a log; its place and tables may tell more."""
        if log is None:
            return cls()
        own = _id_in(log, rules.parameter) if rules.by == "log" else None
        return cls(own, " ".join(filter(None, (log.kind, log.vehicle))), log_start(log))


def identify_log(
    log: Log | None, address: str, changed_s: float | None, rules: VehicleRules, tables: FleetTables
) -> LogIdentity:
    """Who flew a log and when, as the rules of the fleet tell.

    Parameters
    ----------
    log : Log or None
        None where it cannot be read: its place may tell all the same.
    address : str
    changed_s : float or None
        Time of the file's last change, s since 1970.
    rules : VehicleRules
    tables : FleetTables
    """
    return identity_of(LogWitness.of(log, rules), address, changed_s, rules, tables)


def identity_of(
    seen: LogWitness,
    address: str,
    changed_s: float | None,
    rules: VehicleRules,
    tables: FleetTables,
) -> LogIdentity:
    """The same by what is known of the log already."""
    own = _own_id(seen, address, rules)
    of_vehicle, of_flight = tables.of(own, address)
    kind = of_vehicle.get("type") or rules.type or seen.type
    flown_at, source = _flown_at(seen, address, changed_s, of_flight.get("flown_at"))
    others = {k: v for k, v in (of_vehicle | of_flight).items() if k not in OWN}
    name = of_flight.get("vehicle") or of_vehicle.get("vehicle") or own
    told = tables.told(own, address)
    return LogIdentity(name, kind, flown_at, source, others, own, told)


def _own_id(seen: LogWitness, address: str, rules: VehicleRules) -> str | None:
    path = PurePosixPath(address)
    if rules.by == "folder":
        return path.parent.name or None
    if rules.by == "name":
        found = re.search(rules.pattern or "(.*)", path.name)
        return None if found is None else found.group(1)
    return seen.own


def _id_in(log: Log, parameter: str | None) -> str | None:
    if parameter is not None:
        value = log.parameters.get(parameter)
        return None if value is None else f"{value:.10g}"
    serial = log.parameters.get(SERIAL, 0.0)
    if serial:
        return f"{serial:.10g}"
    return log.board or None


def _flown_at(
    seen: LogWitness, address: str, changed_s: float | None, said: str | None
) -> tuple[datetime.datetime | None, str | None]:
    if said:
        return instant_of(said), "table"
    if seen.started is not None:
        return seen.started, "log"
    named = DATES.search(PurePosixPath(address).name)
    if named is not None:
        year, month, day = map(int, named.groups())
        try:
            return datetime.datetime(year, month, day), "name"
        except ValueError:
            pass
    if not changed_s:  # 1970: the page knew no date of a file that was dropped
        return None, None
    at = datetime.datetime.fromtimestamp(changed_s, datetime.UTC)
    return at.replace(tzinfo=None, microsecond=0), "file"
