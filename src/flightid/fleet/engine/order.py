"""What a worker needs to take logs: files as bytes, so that a machine far away has them too."""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, field
from pathlib import Path
from typing import Any

from flightid.fleet.addresses import LogAddress
from flightid.fleet.catalogue.schema import SCHEMA
from flightid.fleet.identity import FleetTables
from flightid.fleet.settings import FleetSettings
from flightid.frozen import dataclass
from flightid.study.run import named_paths
from flightid.study.settings import read_settings
from flightid.version import VERSION


@dataclass(frozen=True)
class RunOrder:
    """What every log of a run is taken with; plain values, as they go to a process.

    Attributes
    ----------
    files : mapping of str to str
        Fleet file, study and what it names, in base64, by path below their common folder.
    fleet : str
        Which of them is the fleet file.
    place : str
        Folder or address of the catalogue of this study and version.
    vehicles : mapping of str to mapping of str to str
        The table of vehicles.
    reports : str or None
        Folder for every log's page.
    memory_mib, recycle : int
    time_s : float
    claimant : str
        Name of the run, which no other has: logs are claimed by it. Empty: none is.
    """

    files: Mapping[str, str]
    fleet: str
    place: str
    vehicles: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    reports: str | None = None
    memory_mib: int = 4096
    recycle: int = 200
    time_s: float = 600.0
    claimant: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    def unpack(self, folder: Path) -> Path:
        """Write the files below a folder; path of the fleet file there."""
        for name, content in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(base64.b64decode(content))
        return folder / self.fleet


@dataclass(frozen=True)
class LogOrder:
    """One log that is to be taken.

    Attributes
    ----------
    address : LogAddress
    flight : mapping of str to str
        Its line in the table of flights.
    attempts : int
        Which time it is.
    """

    address: LogAddress
    flight: Mapping[str, str] = field(default_factory=dict)
    attempts: int = 1

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> LogOrder:
        """An order from its plain values."""
        return cls(LogAddress(**values["address"]), values["flight"], values["attempts"])


@dataclass(frozen=True)
class LogOutcome:
    """What became of a log, in the few words that a run needs.

    Attributes
    ----------
    order : LogOrder
    outcome : str
        fitted, refused, failed; ``"known"`` where the catalogue had it; ``"claimed"`` where another
        run is at it; ``"killed"`` where its process ended without a word; ``"storage"`` where
        nothing can be written.
    log : str
        Digest, as far as it was known.
    reason, message : str
    stage : str
    signal : int or None
    elapsed_s : float
    memory_bytes : int or None
    action : str
        What to do about a log without a model.
    vehicle : str
        Of a record that was written now; empty where it names none.
    """

    order: LogOrder
    outcome: str
    log: str
    reason: str = ""
    message: str = ""
    stage: str = ""
    signal: int | None = None
    elapsed_s: float = 0.0
    memory_bytes: int | None = None
    action: str = ""
    vehicle: str = ""


KNOWN, CLAIMED, KILLED, STORAGE = "known", "claimed", "killed", "storage"
SCRATCH = "flightid-order-"
"""How the temporary folder of a process begins: its parent makes it and removes it."""


def study_files(settings: FleetSettings) -> list[Path]:
    """The study of a fleet and the files that it names, but for its log."""
    if settings.study is None:
        return []
    study = read_settings(settings.study)
    named = (path for path in named_paths(study) if path != study.log)
    beside = (path if path.is_absolute() else settings.study.parent / path for path in named)
    return [settings.study, *dict.fromkeys(path for path in beside if path.is_file())]


def run_order(settings: FleetSettings, tables: FleetTables, place: str) -> RunOrder:
    """The order of a fleet file.

    Raises
    ------
    StudyError
        The study cannot be carried out as written.
    """
    paths = [path.absolute() for path in (settings.path, *study_files(settings))]
    top = Path(os.path.commonpath([path.parent for path in paths]))
    files = {
        path.relative_to(top).as_posix(): base64.b64encode(path.read_bytes()).decode()
        for path in paths
    }
    limits = settings.limits
    return RunOrder(
        files,
        settings.path.absolute().relative_to(top).as_posix(),
        place,
        {name: dict(row) for name, row in tables.vehicles.items()},
        f"{settings.catalogue}/reports" if settings.words.reports else None,
        limits.memory_mib,
        limits.recycle,
        limits.time_s,
    )


def recipe(settings: FleetSettings) -> str:
    """Twelve digits for what all records of a fleet depend on.

    Study with the files that it names, version of flightid and of the tables, and how vehicles are
    told apart: where one of them changes, a new set of records begins beside the old one.
    """
    rules = settings.vehicles
    parts: list[object] = [VERSION, SCHEMA, sorted(rules.to_dict().items(), key=str)]
    parts += [_digest(path) for path in study_files(settings)]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:12]


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def orders(addresses: Iterable[LogAddress], tables: FleetTables) -> list[LogOrder]:
    """One order a log, with its line in the table of flights."""
    return [LogOrder(each, dict(tables.flights.get(each.name, {}))) for each in addresses]
