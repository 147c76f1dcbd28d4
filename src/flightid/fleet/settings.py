"""What a fleet file may say: logs, vehicles, study, limits and questions, in TOML.

docs/fleet.md describes every key for people. A fleet file is data: nothing in it is run, and paths
are relative to the file.
"""

from __future__ import annotations

import datetime
import re
from dataclasses import field
from functools import partial
from pathlib import Path
from typing import TypeVar

from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.reading import read_toml
from flightid.study.error_list import ErrorList
from flightid.study.reading import TOP, TableReader, read_table

Made = TypeVar("Made", bound=Options)
SUBJECT = "fleet file"
LEAST_MIB = 512
"""Address space in which a log can be taken at all, MiB."""
RULES = ("log", "folder", "name")
"""How vehicles are told apart: an id inside the log, the folder it lies in, its file name."""


@dataclass(frozen=True)
class FleetWords(Options):
    """What ``[fleet]`` says: which logs, which study, where to."""

    title: str = option(doc="Of the report.")
    logs: tuple[str, ...] = option(
        doc="Folders, globs and addresses such as s3://bucket/2026/, beside the file."
    )
    study: str | None = option(
        None, doc="Study file that every log goes through; default: what each log asks for."
    )
    catalogue: str | None = option(
        None, doc="Folder or address of the catalogue; default: <file>-catalogue beside the file."
    )
    reports: bool = option(False, doc="Keep every log's page, beside the catalogue's tables.")
    notes: str = option("", doc="Words for the report.")


@dataclass(frozen=True)
class VehicleRules(Options):
    """What ``[vehicles]`` says: how vehicles are told apart, and what is known of them."""

    by: str = option("log", choices=RULES, doc="Where the id of a vehicle stands.")
    parameter: str | None = option(
        None, doc="Parameter of the log that holds the id; default: serial number, then board."
    )
    pattern: str | None = option(
        None, doc="Regular expression on the file name, whose first group is the id."
    )
    type: str | None = option(None, doc="Vehicle type of all; default: kind and frame in the log.")
    table: str | None = option(
        None, doc="CSV of vehicles: id, and any of vehicle, type; other columns are covariates."
    )
    flight_table: str | None = option(
        None, doc="CSV of flights: log (file name), and any of flown_at; the others are covariates."
    )


@dataclass(frozen=True)
class RunLimits(Options):
    """What ``[limits]`` says: what one log may cost."""

    time_s: float = option(600.0, unit="s", above=0.0, maximum=1e6, doc="Longest time for one log.")
    memory_mib: int = option(
        4096,
        unit="MiB",
        minimum=LEAST_MIB,
        maximum=1 << 24,
        doc="Most address space of the process that takes a log.",
    )
    log_mib: int = option(2048, unit="MiB", minimum=1, doc="Longest log that is fetched.")
    recycle: int = option(200, minimum=1, doc="Logs after which a process is replaced.")
    compact_every: int = option(1000, minimum=1, doc="Logs after which tables are compacted.")


@dataclass(frozen=True)
class FleetQuestions(Options):
    """What ``[questions]`` says: what is asked of all models together."""

    population: bool = option(
        True, doc="What vehicles of a type have in common, and how far apart."
    )
    drift: bool = option(True, doc="Which vehicles change over time.")
    outliers: bool = option(True, doc="Which vehicles differ from their type.")
    covariates: tuple[str, ...] = option(
        (), doc="What is taken out before drift is looked for, by the catalogue's names."
    )
    parameters: tuple[str, ...] = option(
        (), doc="Parameters that are asked about; default: all that are free."
    )
    level: float = option(0.95, above=0.0, below=1.0, doc="Of every interval that is shown.")


@dataclass(frozen=True)
class EventSettings(Options):
    """One ``[[event]]``: something was done to a vehicle, or to all."""

    date: str = option(doc="Day or instant, UTC: 2026-03-01.")
    what: str = option(doc="What was done, such as motor replaced.")
    vehicle: str | None = option(None, doc="To which; default: to all.")

    @property
    def instant(self) -> datetime.datetime:
        """The date as an instant, UTC."""
        return instant_of(self.date)


@dataclass(frozen=True)
class FleetSettings:
    """A whole fleet file, checked.

    Attributes
    ----------
    path : Path
        The file.
    words : FleetWords
    vehicles : VehicleRules
    limits : RunLimits
    questions : FleetQuestions
    events : tuple of EventSettings

    Example
    -------
    >>> settings = FleetSettings(Path("fleet.toml"), FleetWords("Survey", ("logs",)))
    >>> settings.catalogue, settings.limits.time_s
    ('fleet-catalogue', 600.0)
    """

    path: Path
    words: FleetWords
    vehicles: VehicleRules = field(default_factory=VehicleRules)
    limits: RunLimits = field(default_factory=RunLimits)
    questions: FleetQuestions = field(default_factory=FleetQuestions)
    events: tuple[EventSettings, ...] = ()

    def place(self, text: str) -> str:
        """A path of the file, from its folder; an address as it is."""
        return text if "://" in text else str(self.path.parent / text)

    @property
    def catalogue(self) -> str:
        """Folder or address of the catalogue."""
        given = self.words.catalogue
        return self.place(f"{self.path.stem}-catalogue" if given is None else given)

    @property
    def study(self) -> Path | None:
        """Study file, where one is named."""
        return None if self.words.study is None else self.path.parent / self.words.study


def instant_of(text: str) -> datetime.datetime:
    """An ISO 8601 day or instant as UTC without zone, as the catalogue keeps it.

    Raises
    ------
    ValueError
        It is none.

    Example
    -------
    >>> instant_of("2026-03-01T12:00:00+02:00")
    datetime.datetime(2026, 3, 1, 10, 0)
    """
    found = datetime.datetime.fromisoformat(text.strip())
    if found.tzinfo is None:
        return found
    try:
        return found.astimezone(datetime.UTC).replace(tzinfo=None)
    except OverflowError as error:
        raise ValueError("beyond the first or last year of a calendar") from error


def read_fleet(path: str | Path) -> FleetSettings:
    r"""Read and check a fleet file.

    Parameters
    ----------
    path : str or Path
        TOML file; docs/fleet.md describes it.

    Raises
    ------
    StudyError
        The file is no TOML, a key is unknown or missing, a value does not fit, or a file that it
        names is not there; all of it at once where there are several.

    Example
    -------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "fleet.toml")
    ...     _ = path.write_text("[fleet]\ntitle = 'Survey'\nlogs = ['logs', 's3://bucket/2026/']")
    ...     read_fleet(path).words.logs
    ('logs', 's3://bucket/2026/')
    """
    return _read(Path(path), tables=True)


def read_order(path: Path) -> FleetSettings:
    """The same in a worker, to which tables beside the file were sent as lines of each log.

    Raises
    ------
    StudyError
        As `read_fleet`, but for the tables.
    """
    return _read(path, tables=False)


def _read(source: Path, *, tables: bool) -> FleetSettings:
    values = read_toml(source, f"the {SUBJECT}", StudyError)
    root, collected = TableReader(values, TOP, SUBJECT), ErrorList()
    words = collected.read(_table, None, FleetWords, root, "fleet")
    vehicles = collected.read(_table, VehicleRules(), VehicleRules, root, "vehicles")
    limits = collected.read(_table, RunLimits(), RunLimits, root, "limits")
    questions = collected.read(_table, FleetQuestions(), FleetQuestions, root, "questions")
    readers = collected.read(partial(root.tables, "event"), [])
    events = collected.each(readers, partial(read_table, EventSettings))
    collected.read(root.finish, None)
    for event in events:
        collected.read(_require_date, None, event)
    collected.read(_require_rule, None, vehicles)
    if words is not None:
        collected.read(_require_names, None, words)
    beside = (vehicles.table, vehicles.flight_table) if tables else ()
    for name in filter(None, (None if words is None else words.study, *beside)):
        collected.read(_require_file, None, source.parent / name)
    collected.finish(SUBJECT)
    assert words is not None
    return FleetSettings(source, words, vehicles, limits, questions, events)


def _table(kind: type[Made], root: TableReader, name: str) -> Made:
    return read_table(kind, root.table(name))


def _require_date(event: EventSettings) -> None:
    try:
        _ = event.instant
    except ValueError as error:
        raise StudyError(
            f"fleet file, [[event]] {event.what!r}: date has no meaning",
            found=repr(event.date),
            needed="a day or an instant, such as 2026-03-01",
        ) from error


def _require_rule(rules: VehicleRules) -> None:
    if (rules.by == "name") != (rules.pattern is not None):
        raise StudyError(
            "fleet file, [vehicles]: pattern belongs to by = 'name'",
            found=f"by = {rules.by!r}, pattern = {rules.pattern!r}",
            needed="both or neither",
        )
    if rules.pattern is None:
        return
    try:
        groups = re.compile(rules.pattern).groups
    except (re.error, OverflowError, RecursionError) as error:
        raise StudyError(
            "fleet file, [vehicles]: pattern is no regular expression",
            found=str(error) or "groups nested too deeply",
        ) from error
    if groups < 1:
        raise StudyError(
            "fleet file, [vehicles]: pattern has no group",
            found=repr(rules.pattern),
            needed="parentheses around the id, such as (V[0-9]+)",
        )


def _require_names(words: FleetWords) -> None:
    """Places that a system can have: none of them holds the byte that ends a name."""
    for each in (*words.logs, words.catalogue or ""):
        if "\0" in each:
            raise StudyError("fleet file, [fleet]: no name may hold a zero byte", found=repr(each))


def _require_file(path: Path) -> None:
    if "\0" in str(path) or not path.is_file():
        raise StudyError("fleet file: a file that it names is not there", found=str(path))
