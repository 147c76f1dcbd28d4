"""What a study file may say: its schema, read from TOML into typed settings.

docs/study.md describes every key for people. A study file is data: nothing in it is run, and paths
are relative to the file.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flightid.errors import StudyError
from flightid.record import InputShape
from flightid.study.conditioning import Conditioning, read_conditioning, require_records
from flightid.study.fit_settings import FitSettings, VerifySettings, read_fit, read_verify
from flightid.study.flight import FlightPlan, read_flight
from flightid.study.model_settings import ModelSettings, read_model
from flightid.study.qualities import QualitiesSettings, read_qualities
from flightid.study.reading import TOP, TableReader
from flightid.study.record_files import UNKNOWN, RecordFile, read_record_file, read_shape
from flightid.study.reducing import ReduceSettings, read_reduce
from flightid.study.references import require_conditions, require_references
from flightid.study.response_settings import ResponseSettings, read_response
from flightid.study.tuning import TuneSettings, read_tune
from flightid.study.uses_settings import UsesSettings, read_uses

MAXIMUM_BYTES = 1 << 20


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
    shape : InputShape
        What is known of the inputs beyond their samples.
    """

    name: str
    span_s: tuple[float, float] | None = None
    sid_axis: int | None = None
    run: int = 0
    shape: InputShape = UNKNOWN


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
    response: ResponseSettings
    fit: FitSettings
    check: VerifySettings
    conditioning: tuple[Conditioning, ...] = ()
    reduce: ReduceSettings | None = None
    tune: TuneSettings | None = None
    qualities: QualitiesSettings | None = None
    uses: UsesSettings = field(default_factory=UsesSettings)

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
    conditioning = tuple(read_conditioning(reader) for reader in root.tables("conditioning"))
    response = read_response(root.table("response"))
    fit = read_fit(root.table("fit"))
    check = read_verify(root.table("verify"))
    reducing = root.maybe(lambda key: read_reduce(root.table(key)), "reduce")
    tuning = root.maybe(lambda key: read_tune(root.table(key)), "tune")
    qualities = root.maybe(
        lambda key: read_qualities(root.table(key), path.parent), "handling_qualities"
    )
    models = tuple(
        read_model(
            reader,
            path.parent,
            response=response,
            fit=fit,
            check=check,
            reduced=reducing is not None,
        )
        for reader in root.tables("model")
    )
    uses = read_uses(root, [model.name for model in models])
    root.finish()
    if files and segments:
        raise StudyError(
            "study file: [[segment]] cuts a log, and there is none",
            needed="span_s in a [[record]]",
        )
    kind = "record" if files else "segment"
    require_references(files or segments, models, kind=kind)
    require_conditions(models)
    require_records(conditioning, [each.name for each in files or segments])
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
        response,
        fit,
        check,
        conditioning,
        reducing,
        tuning,
        qualities,
        uses,
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
    shape = read_shape(reader)
    reader.finish()
    if (span is None) == (axis is None):
        raise reader.error(
            "span_s or sid_axis", "must be given, not both", found=name, needed="one of them"
        )
    return Segment(name, span, axis, run, shape)
