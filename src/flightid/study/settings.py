"""What a study file may say: its schema, read from TOML into typed settings.

docs/study.md describes every key for people. A study file is data: nothing in it is run, and paths
are relative to the file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.logs.to_record import EXCITATION
from flightid.option_forms import NOTHING, SPAN
from flightid.options import Options, option
from flightid.reading import read_toml
from flightid.study.conditioning import Conditioning, read_conditioning, require_records
from flightid.study.error_list import ErrorList
from flightid.study.fit_settings import FitSettings, VerifySettings, read_fit
from flightid.study.flight import FlightPlan, read_flight
from flightid.study.model_settings import ModelSettings, placed, read_model
from flightid.study.pilot_settings import PilotSettings, read_pilot
from flightid.study.qualities_settings import QualitiesSettings, read_qualities
from flightid.study.reading import TOP, TableReader, read_table
from flightid.study.record_files import RecordFile, read_record_file
from flightid.study.reducing import ReduceSettings, read_reduce
from flightid.study.references import require_conditions, require_references
from flightid.study.response_settings import ResponseSettings
from flightid.study.shape_options import ShapeOptions
from flightid.study.tuning import TuneSettings, read_tune
from flightid.study.uses_settings import UsesSettings, read_uses
from flightid.study.view_settings import ViewSettings, read_views
from flightid.uncertainty.quantiles import LEVEL
from flightid.vehicles import GainFlightOptions

Value = TypeVar("Value")


@dataclass(frozen=True)
class StudyWords(Options):
    """What ``[study]`` says of the whole study."""

    title: str = option(doc="Of the report.")
    aircraft: str = option("", doc="Vehicle and weight, rig and rate.")
    notes: str = option("", doc="Words for the report.")
    level: float = option(
        LEVEL, above=0.0, below=1.0, doc="Of every interval that the report shows."
    )


@dataclass(frozen=True)
class LogFile(Options):
    """What ``[log]`` says."""

    path: str = option(doc="The flight log, beside the study.")


@dataclass(frozen=True)
class LogChannels(Options):
    """What ``[channels]`` says of reading a log."""

    map: str | None = option(
        None, doc="Shipped channel map, or a file (*.toml); default: by autopilot and vehicle."
    )
    gaps: str = option(
        "error", choices=("error", "interpolate"), doc="Where a channel has no samples for long."
    )
    max_gap_s: float | None = option(
        None, unit="s", above=0.0, doc="Longest gap that is bridged; default: the reader's."
    )
    sample_rate_hz: float | None = option(
        None, unit="Hz", above=0.0, doc="Of the records; default: the slowest needed channel's."
    )


@dataclass(frozen=True)
class Segment(ShapeOptions):
    """A named stretch of the log: a table ``[[segment]]``."""

    name: str = option(doc="Name by which models refer to it.")
    span_s: tuple[float, float] | None = option(
        None, unit="s", forms=(SPAN, NOTHING), doc="Start and stop on the log's clock."
    )
    sid_axis: int | None = option(
        None, minimum=0, doc="Or: the system-identification run of this SID_AXIS."
    )
    run: int = option(0, minimum=0, doc="Which of the runs of that axis.")
    excitation: str = option(
        EXCITATION, doc="Name of the signal injected here; in other segments it is zero."
    )


@dataclass(frozen=True)
class Settings:
    """A whole study, checked.

    Attributes
    ----------
    title, aircraft, notes : str
        Words for the report.
    level : float
        Of every interval that the report shows; verdicts keep 95 %.
    log : Path or None
        Log to read.
    flight : FlightPlan or None
        Or: the flight that is simulated, whose log is then read.
    channel_map : str or None
        Name of a shipped channel map, or path of one (*.toml); None: by autopilot and vehicle.
    gaps : {"error", "interpolate"}
        What to do where a channel has no samples for long.
    max_gap_s : float or None
        Longest gap that is bridged, s; None: the reader's own limit.
    sample_rate_hz : float or None
        Rate of the records; None: the slowest needed channel's.
    segments : tuple of Segment
        Stretches of the log.
    record_files : tuple of RecordFile
        Or: records that are read from files, without a log.
    models : tuple of ModelSettings
        Models to identify, with equations or without.
    response : ResponseSettings
        How to estimate responses, where a model does not say.
    fit : FitSettings
        How to fit models, where one does not say.
    check : VerifySettings
        How to verify models, where one does not say.
    conditioning : tuple of Conditioning
        What is done to records before anything is estimated.
    reduce : ReduceSettings or None
        How structures are reduced after their fit; None: not at all.
    tune : TuneSettings or None
        How the autopilot's gains are tuned; None: not at all.
    uses : UsesSettings
        What is done with the fitted models.
    fly : GainFlightOptions or None
        How tuned gains are flown again in the simulated vehicle; None: not at all.
    qualities : QualitiesSettings or None
        How handling qualities are read off the fits; None: not at all.
    views : ViewSettings
        What is asked of the log besides models.
    pilot : PilotSettings or None
        A flight in real time, which `flightid fly` flies and no run does.
    """

    title: str
    aircraft: str
    notes: str
    level: float
    log: Path | None
    flight: FlightPlan | None
    channel_map: str | None
    gaps: str
    max_gap_s: float | None
    sample_rate_hz: float | None
    segments: tuple[Segment, ...]
    record_files: tuple[RecordFile, ...]
    models: tuple[ModelSettings, ...]
    response: ResponseSettings
    fit: FitSettings
    check: VerifySettings
    conditioning: tuple[Conditioning, ...] = ()
    reduce: ReduceSettings | None = None
    tune: TuneSettings | None = None
    qualities: QualitiesSettings | None = None
    uses: UsesSettings = field(default_factory=UsesSettings)
    fly: GainFlightOptions | None = None
    views: ViewSettings = field(default_factory=ViewSettings)
    pilot: PilotSettings | None = None

    @property
    def injected(self) -> tuple[str, ...]:
        """Names of all signals that were injected in the log's segments."""
        return tuple(dict.fromkeys(segment.excitation for segment in self.segments))

    def segment(self, name: str) -> Segment:
        """Segment of this name."""
        return next(segment for segment in self.segments if segment.name == name)


def read_settings(path: Path) -> Settings:
    """Read and check a study file.

    Parameters
    ----------
    path : Path
        TOML file.

    Raises
    ------
    StudyError
        The file is no TOML, a key is unknown or missing, a value does not fit, or a model refers
        to a segment that is not there; the message names the place, and all places where there
        are several.
    """
    root, folder = TableReader(read_toml(path, "the study file", StudyError), TOP), path.parent
    collected = ErrorList()
    tables = partial(collected.read, root.tables, [])
    words = collected.read(_words, ("", "", "", LEVEL), root)
    log, flight = collected.read(_source, (None, None), root, folder)
    mapped, gaps, gap_s, rate = collected.read(_channels, (None, "error", None, None), root, folder)
    segments = collected.each(tables("segment"), _segment)
    records = collected.read(_record_tables, [], root)
    files = collected.each(records, read_record_file, folder)
    conditioning = collected.each(tables("conditioning"), read_conditioning)
    table = partial(collected.read, _maybe, None, root)
    before = len(collected.errors)
    response = table("response", partial(read_table, ResponseSettings)) or ResponseSettings()
    fit = table("fit", read_fit) or FitSettings()
    check = table("verify", partial(read_table, VerifySettings)) or VerifySettings()
    reducing = table("reduce", read_reduce)
    tuning = table("tune", read_tune)
    flown_again = table("fly", partial(read_table, GainFlightOptions))
    qualities = table("handling_qualities", read_qualities, folder)
    model = partial(read_model, response=response, fit=fit, check=check, reduced="reduce" in root)
    # What a model lacks hangs on the tables of all: without those, nothing can be said of it.
    readers = tables("model") if len(collected.errors) == before else []
    models = collected.each(readers, model, folder)
    named = [str(values.get("name")) for _, values in collected.read(root.rows, [], "model")]
    uses = collected.read(read_uses, UsesSettings(), root, named)
    views = collected.read(read_views, ViewSettings(), root, folder)
    pilot = table("pilot", read_pilot)
    collected.read(root.finish, None)
    if files and segments:
        collected.errors.append(
            StudyError(
                "study file: [[segment]] cuts a log, and there is none",
                needed="span_s in a [[record]]",
            )
        )
    if flown_again is not None and not ("flight" in root and "tune" in root):
        collected.errors.append(
            StudyError(
                "study file: [fly] flies tuned gains in the vehicle that was simulated",
                needed="[flight] and [tune] beside it",
            )
        )
    # What refers to a part that could not be read is no error of its own.
    if not collected.errors:
        kind, known = "record" if files else "segment", [each.name for each in files or segments]
        if models or views == ViewSettings():
            collected.read(partial(require_references, kind=kind), None, files or segments, models)
        collected.read(require_conditions, None, models)
        collected.read(require_records, None, conditioning, known)
    collected.finish()
    return Settings(
        *words,
        log,
        flight,
        mapped,
        gaps,
        gap_s,
        rate,
        segments,
        files,
        models,
        response,
        fit,
        check,
        conditioning,
        reducing,
        tuning,
        qualities,
        uses,
        flown_again,
        views,
        pilot,
    )


def _maybe(
    root: TableReader,
    key: str,
    read: Callable[..., Value],
    *inputs: Any,  # noqa: ANN401 - whatever the table's reader takes
) -> Value | None:
    """A table that may be absent."""
    inner = root.table(key)
    return read(inner, *inputs) if key in root else None


def _words(root: TableReader) -> tuple[str, str, str, float]:
    made = read_table(StudyWords, root.table("study"))
    return made.title, made.aircraft, made.notes, made.level


def _channels(
    root: TableReader, folder: Path
) -> tuple[str | None, str, float | None, float | None]:
    """Map of channels, what to do about gaps, their longest, and the rate."""
    made = read_table(LogChannels, root.table("channels"))
    return (
        None if made.map is None else placed(folder, made.map),
        made.gaps,
        made.max_gap_s,
        made.sample_rate_hz,
    )


def _record_tables(root: TableReader) -> list[TableReader]:
    """Tables of the records, each over what [defaults.record] says of all."""
    defaults = root.table("defaults")
    common = defaults.values("record")
    defaults.finish()
    rows = root.rows("record")
    if common and not rows:
        raise StudyError(
            "study file: [defaults.record] is meant for records, and there is none",
            needed="a [[record]]",
        )
    return [TableReader(_over(common, values), where) for where, values in rows]


def _over(common: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Values over common ones; tables of both are joined."""
    joined = {**common, **values}
    for key, value in common.items():
        if isinstance(value, dict) and isinstance(values.get(key), dict):
            joined[key] = {**value, **values[key]}
    return joined


def _source(root: TableReader, folder: Path) -> tuple[Path | None, FlightPlan | None]:
    log, flight = root.table("log"), root.table("flight")
    given = [key for key in ("log", "flight", "record") if key in root]
    if len(given) != 1:
        raise StudyError(
            "study file: the source of the data is not clear",
            found=" and ".join(f"[{key}]" for key in given) or "none",
            needed="one of [log], [flight] and [[record]]",
            action="" if given or "pilot" not in root else "[pilot] alone is for flightid fly",
        )
    if "log" in root:
        return folder / read_table(LogFile, log).path, None
    return None, read_flight(flight, folder) if "flight" in root else None


def _segment(reader: TableReader) -> Segment:
    made = read_table(Segment, reader)
    if (made.span_s is None) == (made.sid_axis is None):
        raise reader.error(
            "span_s or sid_axis", "must be given, not both", found=made.name, needed="one of them"
        )
    return made
