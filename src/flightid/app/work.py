"""What the worker processes do: each call a function of paths, whose result is a file or values.

A refusal comes back as a sentence: errors with words of their own do not cross processes.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from flightid.app.overview import light_of, overview_of, review_of
from flightid.app.own_folders import draft_of
from flightid.app.pyramid import Pyramid
from flightid.app.schemas import FieldGroup, ResponseCurve, ResponsePart, ShownFinding
from flightid.app.stage_cache import StageCache
from flightid.app.study_edits import KeyEdit, edited
from flightid.app.study_history import StudyHistory
from flightid.app.study_reach import draft_inside
from flightid.errors import FlightidError, OptionError
from flightid.files import write_atomically
from flightid.logs import Log, read_log
from flightid.logs.field_formula import field_formula
from flightid.reading import memory_budget
from flightid.responses import FrequencyResponse
from flightid.responses.response_band import ResponseIntervals, response_bands
from flightid.review import review_flight
from flightid.review.timeline import flight_timeline
from flightid.study.preview import preview_responses
from flightid.study.proposal import Proposal, propose_study
from flightid.study.settings import Settings, read_settings
from flightid.study.stage_runner import StageRunner

BESIDE_BYTES = 2 << 30
"""What a worker may take beside a file of the largest size."""


AS_WINDOWS_GAVE = "of random errors alone; leakage is taken out when no hand drags"
KEPT = StageCache()
"""Of this process; the next request on the same log finds it open."""


def begin(shared: Path) -> None:
    """Begin a worker: bound what it may allocate, where the system can, and share slow stages."""
    KEPT.share(shared)
    try:
        import resource  # noqa: PLC0415 - not on every system
    except ImportError:
        return
    most = memory_budget() * 2 + BESIDE_BYTES
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def answered(work: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
    """Result, sentence of a refusal (empty where there is none), and seconds taken."""
    begun = time.perf_counter()
    try:
        made, said = work(*inputs), ""
    except FlightidError as error:
        made, said = None, str(error)
    except (OSError, MemoryError) as error:
        made, said = None, f"{type(error).__name__}: {error}"
    return made, said, time.perf_counter() - begun


def warm() -> None:
    """Nothing but what an import of this file has loaded."""


def make_overview(path: Path, study: Path, result: Path) -> None:
    """Inspect a log once, write the study that it asks for, and what the page shows of both."""
    cache: dict[str, Any] = {}
    made = propose_study([path], folder=study.parent, cache=cache)
    inspection = made.inspection
    assert inspection is not None
    # Read by the proposal: asked for by its path again, its bytes would be hashed again.
    (log,) = (each for each in cache.values() if isinstance(each, Log))
    if made.models and not study.exists():
        made.write(study)
        # As with every text that ever stood, an editor may take it away before a page has read it.
        with suppress(OSError, OptionError):
            StudyHistory(study.parent.parent).seen(study.stem, made.text)
    timeline = flight_timeline(log, inspection)
    shown = overview_of(log, inspection, timeline, made.findings, _settings_of(study, made))
    write_atomically(result, shown.model_dump_json())


def _settings_of(study: Path, made: Proposal) -> Settings | None:
    """What the study asks; of one that cannot be read what its log would be asked."""
    if not study.exists():
        return None
    try:
        return read_settings(study)
    except FlightidError:
        if not made.models:
            return None
        with draft_of(study, made.text) as draft:
            return read_settings(draft)


def make_review(path: Path, result: Path) -> None:
    """Review a flight, and write what the page shows of it."""
    write_atomically(result, review_of(review_flight(path)).model_dump_json())


def make_fields(path: Path, result: Path) -> None:
    """List the fields of a log's messages."""
    groups = [
        FieldGroup(
            message=info.name,
            instances=list(info.instances),
            rate_hz=info.rate_hz,
            fields={n: unit for n, unit in info.fields.items() if n not in info.text_fields},
        )
        for info in _log(path, KEPT).messages.values()
        if info.first_s is not None
    ]
    dumped = [group.model_dump() for group in groups]
    write_atomically(result, json.dumps({"groups": dumped}, allow_nan=False))


def make_pyramid(path: Path, message: str, instance: int | None, field: str, result: Path) -> None:
    """Write a field of a log with its levels."""
    table = _log(path, KEPT).table(message, instance)
    Pyramid.of(table.time_s, table[field]).write(result)


def make_formula(path: Path, formula: str, result: Path) -> str:
    """Write a formula of fields of a log with its levels; returns its unit."""
    made = field_formula(_log(path, KEPT), formula)
    Pyramid.of(made.time_s, made.values).write(result)
    return made.unit


def make_responses(
    study: Path, text: str, model: str, edits: Sequence[KeyEdit], around: bool, intervals: bool
) -> Mapping[str, Any]:
    """Responses of a model by a study with edits that are not written yet."""
    with draft_inside(study, edited(text, edits) if edits else text) as draft:
        made = preview_responses(draft, model, around=around, cache=KEPT)
    curves = [
        curve
        for name, each in made.responses.items()
        for curve in _curves(name, each, intervals=intervals)
    ]
    wide = [] if made.around is None else _curves("around", made.around, intervals=False)
    told = [each.shown if intervals else each for each in made.responses.values()]
    findings = {(f.code, f.message): f for each in told for f in each.findings}.values()
    settings = made.settings
    return ResponsePart(
        model=settings.name,
        band_rad_s=settings.band_rad_s,
        minimum_coherence=settings.response.minimum_coherence,
        estimators=list(made.responses),
        curves=curves,
        around=wide,
        findings=[
            ShownFinding(
                code=f.code,
                light=light_of(f.light),
                message=f.message,
                action=f.action,
                spans_s=[],
            )
            for f in findings
        ],
    ).model_dump()


def _log(path: Path, cache: dict[str, Any]) -> Log:
    return StageRunner(cache).stage("log", read_log, path).value


def _curves(name: str, response: FrequencyResponse, *, intervals: bool) -> list[ResponseCurve]:
    pairs = [(output, source) for output in response.outputs for source in response.inputs]
    bands: Mapping[tuple[str, str], ResponseIntervals | None] = dict.fromkeys(pairs)
    if intervals:  # while a hand drags, what the windows gave: no pilot is as fast
        response = response.shown
        bands = response_bands(response, pairs)
    made = []
    for output, source in pairs:
        pair = response.pair(output, source)
        curve = ResponseCurve(
            estimator=name,
            output=output,
            input=source,
            unit=pair.unit,
            omega_rad_s=pair.omega_rad_s.tolist(),
            gain=[abs(each) for each in pair.response.tolist()],
            phase_rad=pair.phase_rad.tolist(),
            coherence=pair.coherence.tolist(),
            random_error=pair.random_error.tolist(),
            reason="" if intervals else AS_WINDOWS_GAVE,
        )
        made.append(_with_intervals(curve, bands[output, source]))
    return made


def _with_intervals(curve: ResponseCurve, band: ResponseIntervals | None) -> ResponseCurve:
    if band is None:
        return curve
    # Where noise could hide all, the phase is not known: an interval of a turn and more.
    high = [each if math.isfinite(each) else 1e300 for each in band.gain[1].tolist()]
    return curve.model_copy(
        update={
            "gain_low": band.gain[0].tolist(),
            "gain_high": high,
            "phase_low_rad": band.phase_rad[0].tolist(),
            "phase_high_rad": band.phase_rad[1].tolist(),
            "reason": band.reason,
        }
    )


def kept_log(path: Path) -> Log:
    """A log that this process holds open."""
    return _log(path, KEPT)
