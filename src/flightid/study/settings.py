"""What a study file may say: its schema, read from TOML into typed settings.

docs/study.md describes every key for people. A study file is data: nothing in it is run, and paths
are relative to the file.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast

from flightid.errors import StudyError
from flightid.study.black_box_settings import BlackBoxSettings, read_black_box
from flightid.study.flight import FlightPlan, read_flight
from flightid.study.qualities import QualitiesSettings, read_qualities
from flightid.study.reading import TOP, TableReader
from flightid.study.record_files import RecordFile, read_record_file
from flightid.study.reducing import ReduceSettings, read_reduce
from flightid.study.references import require_references
from flightid.study.tuning import TuneSettings, read_tune

MAXIMUM_BYTES = 1 << 20
ESTIMATORS = ("composite", "local_polynomial", "instrument")
FITS = ("frequency_domain", "output_error")


@dataclass(frozen=True)
class Segment:
    """A named stretch of the log.

    Attributes
    ----------
    name : str
        Name by which models refer to it.
    span_s : tuple of float or None
        Start and stop, s of the log's clock.
    sid_axis : int or None
        Or: the system-identification run of this ``SID_AXIS``.
    run : int
        Which of the runs of that axis, from 0.
    """

    name: str
    span_s: tuple[float, float] | None = None
    sid_axis: int | None = None
    run: int = 0


@dataclass(frozen=True)
class ModelSettings:
    """One model to identify.

    Attributes
    ----------
    name : str
        Title in the report.
    template : str
        Name of a library model, or path of a model file.
    axis : str or None
        Axis of a library model that is written for any.
    identify, verify : tuple of str
        Segments for the fit, and segments kept for verification.
    band_rad_s : tuple of float or None
        Lowest and highest frequency of the fit, rad/s; None where records are fitted.
    parameters : mapping
        Overrides by parameter: value, min, max, free.
    rivals : mapping of str to str
        Models to verify side by side: library name, or path of a model file, by name.
    keep, drop : tuple of str
        Parameters that a reduction leaves in, or takes out first.
    """

    name: str
    template: str
    axis: str | None
    identify: tuple[str, ...]
    verify: tuple[str, ...]
    band_rad_s: tuple[float, float] | None
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    rivals: Mapping[str, str] = field(default_factory=dict)
    keep: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()

    @property
    def segments(self) -> tuple[str, ...]:
        """Every segment that the model uses."""
        return (*self.identify, *self.verify)

    @property
    def template_path(self) -> Path | None:
        """Path of the model file; None for a library model."""
        return Path(self.template) if self.template.endswith(".toml") else None


@dataclass(frozen=True)
class ResponseSettings:
    """How frequency responses are estimated.

    Attributes
    ----------
    estimator : str
        Estimator whose result is fitted.
    compare : tuple of str
        Estimators shown beside it.
    n_omega : int
        Frequencies in each model's band, spaced evenly in the logarithm.
    window_s : tuple of float
        Window lengths, s; empty: chosen by the estimator.
    minimum_coherence : float
        Frequencies below it take no part in a fit.
    """

    estimator: str = "composite"
    compare: tuple[str, ...] = ()
    n_omega: int = 60
    window_s: tuple[float, ...] = ()
    minimum_coherence: float = 0.6


@dataclass(frozen=True)
class Settings:
    """A whole study, checked.

    Attributes
    ----------
    title, aircraft, notes : str
        Words for the report.
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
        Models with equations to identify.
    black_boxes : tuple of BlackBoxSettings
        Models without.
    response : ResponseSettings
        How to estimate responses.
    method : str
        How models are fitted: ``"frequency_domain"`` to responses, ``"output_error"`` straight to
        the records.
    starts, seed : int
        Starts of each fit, and the seed they are drawn with.
    initial_state : {"trim", "estimate"}
        Whether a prediction starts at rest or from a state that is solved for.
    reduce : ReduceSettings or None
        How structures are reduced after their fit; None: not at all.
    tune : TuneSettings or None
        How the autopilot's gains are tuned; None: not at all.
    qualities : QualitiesSettings or None
        How handling qualities are read off the fits; None: not at all.
    """

    title: str
    aircraft: str
    notes: str
    log: Path | None
    flight: FlightPlan | None
    channel_map: str | None
    gaps: str
    max_gap_s: float | None
    sample_rate_hz: float | None
    segments: tuple[Segment, ...]
    record_files: tuple[RecordFile, ...]
    models: tuple[ModelSettings, ...]
    black_boxes: tuple[BlackBoxSettings, ...]
    response: ResponseSettings
    method: str
    starts: int
    seed: int
    initial_state: Literal["trim", "estimate"]
    reduce: ReduceSettings | None = None
    tune: TuneSettings | None = None
    qualities: QualitiesSettings | None = None

    @property
    def on_records(self) -> bool:
        """Whether models are fitted to records, without responses."""
        return self.method != FITS[0]

    def segment(self, name: str) -> Segment:
        """Segment of this name."""
        return next(segment for segment in self.segments if segment.name == name)


def read_settings(path: Path) -> Settings:
    """Read and check a study file.

    Parameters
    ----------
    path : Path
        TOML file.

    Returns
    -------
    Settings

    Raises
    ------
    StudyError
        The file is no TOML, a key is unknown or missing, a value does not fit, or a model refers
        to a segment that is not there; the message names the place.
    """
    root = TableReader(_parsed(path), TOP)
    title = root.table("study")
    words = (title.text("title"), title.text("aircraft", ""), title.text("notes", ""))
    title.finish()
    log, flight = _source(root, path.parent)
    channels = root.table("channels")
    mapped = channels.maybe(channels.text, "map")
    if mapped is not None and mapped.endswith(".toml"):
        mapped = str(path.parent / mapped)
    gaps = channels.choice("gaps", ("error", "interpolate"), "error")
    max_gap_s = channels.maybe(channels.positive, "max_gap_s")
    rate = channels.maybe(channels.positive, "sample_rate_hz")
    channels.finish()
    segments = tuple(_segment(reader) for reader in root.tables("segment"))
    files = tuple(read_record_file(reader, path.parent) for reader in root.tables("record"))
    response = _response(root.table("response"))
    fit = root.table("fit")
    identify = root.table("identify")
    method = identify.choice("method", FITS, FITS[0])
    identify.finish()
    starts, seed = fit.integer("starts", 1, minimum=1), fit.integer("seed", 0)
    fit.finish()
    check = root.table("verify")
    initial_state = cast(
        Literal["trim", "estimate"], check.choice("initial_state", ("trim", "estimate"), "trim")
    )
    check.finish()
    on_records = method != FITS[0]
    reducing = root.maybe(lambda key: read_reduce(root.table(key)), "reduce")
    tuning = root.maybe(lambda key: read_tune(root.table(key)), "tune")
    qualities = root.maybe(
        lambda key: read_qualities(root.table(key), path.parent), "handling_qualities"
    )
    readers = root.tables("model")
    models = tuple(
        _model(reader, path.parent, on_records=on_records, reduced=reducing is not None)
        for reader in readers
        if "structure" not in reader
    )
    boxes = tuple(read_black_box(reader) for reader in readers if "structure" in reader)
    root.finish()
    if files and segments:
        raise StudyError(
            "study file: [[segment]] cuts a log, and there is none",
            needed="span_s in a [[record]]",
        )
    kind = "record" if files else "segment"
    require_references(files or segments, (*models, *boxes), kind=kind)
    return Settings(
        *words,
        log,
        flight,
        mapped,
        gaps,
        max_gap_s,
        rate,
        segments,
        files,
        models,
        boxes,
        response,
        method,
        starts,
        seed,
        initial_state,
        reducing,
        tuning,
        qualities,
    )


def _parsed(path: Path) -> dict[str, Any]:
    if path.stat().st_size > MAXIMUM_BYTES:
        raise StudyError(
            "the study file is too long", found=f"{path.stat().st_size} bytes", needed="1 MiB"
        )
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise StudyError("the study file is no TOML", found=str(error) or "deep nesting") from error


def _source(root: TableReader, folder: Path) -> tuple[Path | None, FlightPlan | None]:
    log, flight = root.table("log"), root.table("flight")
    given = [key for key in ("log", "flight", "record") if key in root]
    if len(given) != 1:
        raise StudyError(
            "study file: the source of the data is not clear",
            found=" and ".join(f"[{key}]" for key in given) or "none",
            needed="one of [log], [flight] and [[record]]",
        )
    if "log" in root:
        path = folder / log.text("path")
        log.finish()
        return path, None
    return None, read_flight(flight) if "flight" in root else None


def _segment(reader: TableReader) -> Segment:
    name = reader.text("name")
    span = reader.maybe(reader.interval, "span_s")
    axis = reader.maybe(reader.integer, "sid_axis")
    run = reader.integer("run", 0)
    reader.finish()
    if (span is None) == (axis is None):
        raise reader.error(
            "span_s or sid_axis", "must be given, not both", found=name, needed="one of them"
        )
    return Segment(name, span, axis, run)


def _response(reader: TableReader) -> ResponseSettings:
    usual = ResponseSettings()
    estimator = reader.choice("estimator", ESTIMATORS, usual.estimator)
    compare = reader.names("compare", ())
    for word in compare:
        if word not in ESTIMATORS:
            raise reader.error("compare", "does not fit", found=word, needed=", ".join(ESTIMATORS))
    made = ResponseSettings(
        estimator,
        compare,
        reader.integer("n_omega", usual.n_omega, minimum=5),
        reader.numbers("window_s", ()),
        reader.positive("minimum_coherence", usual.minimum_coherence),
    )
    reader.finish()
    return made


def _model(reader: TableReader, folder: Path, *, on_records: bool, reduced: bool) -> ModelSettings:
    template = reader.text("template")
    band = (
        reader.maybe(reader.interval, "band_rad_s") if on_records else reader.interval("band_rad_s")
    )
    if band is not None and band[0] <= 0:
        raise reader.error("band_rad_s", "does not fit", found=band, needed="positive frequencies")
    made = ModelSettings(
        reader.text("name"),
        str(folder / template) if template.endswith(".toml") else template,
        reader.maybe(reader.text, "axis"),
        reader.names("identify"),
        reader.names("verify", ()),
        band,
        _overrides(reader),
        {
            rival: str(folder / rival) if rival.endswith(".toml") else rival
            for rival in reader.names("rivals", ())
        },
        *((reader.names("keep", ()), reader.names("drop", ())) if reduced else ()),
    )
    reader.finish()
    return made


def _overrides(reader: TableReader) -> dict[str, dict[str, Any]]:
    overrides: dict[str, dict[str, Any]] = {}
    parameters = reader.table("parameters")
    for name in reader.values("parameters"):
        entry = parameters.table(name)
        given: dict[str, Any] = {
            key: entry.maybe(entry.number, key) for key in ("value", "minimum", "maximum")
        }
        given["free"] = entry.maybe(entry.flag, "free")
        entry.finish()
        overrides[name] = {key: value for key, value in given.items() if value is not None}
    return overrides
