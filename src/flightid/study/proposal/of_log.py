"""A study file for a log: axes, sweeps, bands, template, estimator and verification from it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, MutableMapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.inspection import Inspection, inspect_log
from flightid.inspection.axes import axes_of
from flightid.inspection.carried import why_no_model
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.log_clock import begins_later
from flightid.inspection.signals import Span
from flightid.inspection.usable_band import AxisBand, hertz_words
from flightid.logs import Log, read_log
from flightid.logs.dataflash.sid_runs import SidRun
from flightid.models.save import toml_value
from flightid.study.proposal.manoeuvres import liveliest
from flightid.study.proposal.proposal import Proposal
from flightid.study.stage_runner import StageRunner

TEMPLATES = {"roll": "rate_motor_lag", "pitch": "rate_motor_lag", "yaw": "rate_rotor_inertia"}
"""Rate of a multirotor to its mixer's command; in yaw the rotors' own inertia turns it first."""
CHIRP = "chirp"
"""Channel of the maps: the chirp of Betaflight, of whichever axis."""
SEARCHED = ("chirp", "sweep", "autotune")
"""Excitations without a logged injection from which a model may be tried."""


@dataclass(frozen=True)
class _Segment:
    """A stretch of the log: a run of the system-identification mode, or a span."""

    name: str
    run: tuple[int, int] | None = None
    span_s: Span | None = None

    def lines(self) -> Iterator[str]:
        yield from ("", "[[segment]]", f"name = {toml_value(self.name)}")
        if self.run is not None:
            axis, number = self.run
            yield f"sid_axis = {axis}"
            if number:
                yield f"run = {number}"
        if self.span_s is not None:
            yield f"span_s = {toml_value([round(each, 3) for each in self.span_s])}"


@dataclass(frozen=True)
class _Axis:
    """What is identified of one axis."""

    axis: str
    flown: tuple[_Segment, ...]
    unseen: tuple[_Segment, ...]
    band_rad_s: Span
    estimator: str
    template: str
    found: str
    chirped: bool = False

    @property
    def name(self) -> str:
        return f"{self.axis.capitalize()} rate"

    def lines(self) -> Iterator[str]:
        yield from ("", "[[model]]", f"name = {toml_value(self.name)}")
        yield f"template = {toml_value(self.template)}"
        yield f"axis = {toml_value(self.axis)}"
        yield f"identify = {toml_value([each.name for each in self.flown])}"
        if self.unseen:
            yield f"verify = {toml_value([each.name for each in self.unseen])}"
        else:
            yield "# Nothing else moved this axis: fly a doublet, and name its span for verify."
        yield f"# {hertz_words(self.band_rad_s)}: {self.found}"
        yield f"band_rad_s = {toml_value(list(self.band_rad_s))}"
        if self.template == "rate_motor_lag":
            yield "parameters.T_m = { maximum = 0.15 } # the motor is the faster of the two lags"
        if self.chirped:
            yield "# The chirp is logged, so a controller in the loop does not bias the estimate."
            yield f'response = {{ estimator = "instrument", excitations = ["{CHIRP}"] }}'
        elif self.estimator != "instrument":
            yield "# No injection was logged here: a direct estimate, with the loop's bias in it."
            yield f"response = {{ estimator = {toml_value(self.estimator)} }}"


def study_of_log(
    path: Path,
    folder: Path,
    *,
    model: str | None,
    tune: bool,
    cache: MutableMapping[str, Any] | None = None,
    declared: Mapping[str, Any] = MappingProxyType({}),
) -> Proposal:
    """Study file for a log.

    Parameters
    ----------
    path : Path
        The log.
    folder : Path
        Of the study file.
    model : str or None
        Template in place of the usual one.
    tune : bool
        Whether gains are wanted.
    cache : mutable mapping of str to object, optional
        Takes what was read and inspected, for the run of the study.
    declared : mapping of str to object
        Keys of every ``[[segment]]``: hold, period_s and loop.
    """
    runner = StageRunner(cache)
    opened = runner.stage("log", read_log, path)
    log, inspection = opened.value, runner.stage("inspection", inspect_log, opened).value
    axes: list[_Axis] = []
    missed: list[Finding] = []
    for band in inspection.bands:
        made = _axis(log, inspection, band, model)
        if isinstance(made, _Axis):
            axes.append(made)
        else:
            missed.append(made)
    lines = tuple(_lines(path, folder, inspection, axes, missed, tune, declared))
    return Proposal(lines, tuple(axis.name for axis in axes), tuple(missed), inspection)


def _axis(log: Log, inspection: Inspection, band: AxisBand, model: str | None) -> _Axis | Finding:
    """What can be identified of an axis, or why nothing."""
    axis = band.axis
    why = why_no_model(inspection, band)
    if band.band_rad_s is None or why:
        return _missed(inspection, axis, why)
    runs = _runs(log, axis)
    others = [e for e in inspection.excitations if e.axis == axis and e.kind in SEARCHED]
    if model is None and axes_of(log.vehicle)[axis].command not in COMMANDS:
        return _missed(
            inspection, axis, "there is no usual model of this vehicle's surfaces",
            "name one of the library or of your own: --model short_period",
        )  # fmt: skip
    flown, unseen = _flown(log, axis, runs, others)
    if not unseen:
        avoid = [(e.start_s, e.stop_s) for e in inspection.excitations if e.is_injected]
        sid = [(run.start_s - 1.0, run.stop_s + 1.0) for run in log.sid_runs]
        spans = tuple(each.span_s or _span_of(runs[0]) for each in flown)
        quiet = liveliest(log, axis, inspection.phases.airborne, [*avoid, *sid, *spans], spans)
        unseen = tuple(_Segment(f"{axis} flying", span_s=each) for each in quiet)
    said = (
        f"coherence {band.coherence:.2f} on average" if band.coherence is not None else "coherent"
    )
    return _Axis(
        axis, flown, unseen, band.band_rad_s, "instrument" if runs else "composite",
        model or TEMPLATES[axis], f"{said}, inside what was swept",
        not runs and bool(_chirped(others)),
    )  # fmt: skip


def _runs(log: Log, axis: str) -> list[SidRun]:
    """Sweeps of an axis that ran to their end; of none, what was flown of those broken off."""
    made = [run for run in log.sid_runs if str(run.body_axis) == axis]
    return [run for run in made if run.is_complete] or made


COMMANDS = ("tau_phi", "tau_theta", "tau_psi")
"""Mixer commands of multirotors, which the usual models take."""


def _flown(
    log: Log, axis: str, runs: list[SidRun], others: list[FoundExcitation]
) -> tuple[tuple[_Segment, ...], tuple[_Segment, ...]]:
    """Segments of the fit, and a run kept back where there are several."""
    if not runs:
        # A chirp is told from what else moved the axis, which is no part of its fit.
        told = _chirped(others) or others
        numbered = enumerate(((each.start_s, each.stop_s) for each in told), 1)
        made = [_Segment(f"{axis} {k}", span_s=span) for k, span in numbered]
        kept = made[-1:] if len(made) > 1 and _chirped(others) else []
        return tuple(made[: len(made) - len(kept)]), tuple(kept)
    segments = []
    for k, run in enumerate(runs, 1):
        alike = [each for each in log.sid_runs if each.axis == run.axis]
        name = f"{axis} sweep" + (f" {k}" if len(runs) > 1 else "")
        segments.append(_Segment(name, run=(run.axis, alike.index(run))))
    kept = segments[-1:] if len(segments) > 1 else []
    return tuple(segments[: len(segments) - len(kept)]), tuple(kept)


def _chirped(others: list[FoundExcitation]) -> list[FoundExcitation]:
    """Chirps, whose set-point is an instrument."""
    return [each for each in others if each.kind == "chirp"]


def _span_of(run: SidRun) -> Span:
    return run.chirp_span_s


def _missed(inspection: Inspection, axis: str, why: str, action: str = "") -> Finding:
    """Why there is no model of an axis; the inspection's advice where there is none of its own."""
    advice = next((f.action for f in inspection.findings if f.code == "no-excitation"), "")
    return Finding("no-model", Light.RED, f"{axis}: no model, {why}", action or advice)


def _lines(
    path: Path,
    folder: Path,
    inspection: Inspection,
    axes: list[_Axis],
    missed: list[Finding],
    tune: bool,
    declared: Mapping[str, Any],
) -> Iterator[str]:
    """The study file, line by line."""
    yield f"# Study of {path.name}, from what `flightid inspect` finds in it."
    yield "# docs/study.md describes every key; `flightid run` of this file gives the same numbers."
    if begins_later(inspection.start_s):
        stop_s = inspection.start_s + inspection.duration_s
        yield "# Spans are seconds of the autopilot's clock, on which this log runs from"
        yield f"# {inspection.start_s:.1f} to {stop_s:.1f} s."
    for finding in missed:
        yield f"# Left out: {finding.message}."
    yield from ("", "[study]", f"title = {toml_value(f'Rates of {path.stem}')}")
    flown = f"{inspection.firmware or inspection.kind}, {inspection.duration_s:.0f} s"
    yield f"aircraft = {toml_value(flown)}"
    relative = Path(os.path.relpath(path, folder)).as_posix()
    yield from ("", "[log]", f"path = {toml_value(relative)}")
    for axis in axes:
        for segment in (*axis.flown, *axis.unseen):
            yield from segment.lines()
            yield from (f"{name} = {toml_value(value)}" for name, value in declared.items())
    if any(axis.estimator == "instrument" for axis in axes):
        yield ""
        yield "# The injection is logged, so a controller in the loop does not bias the estimate."
        yield from ("[response]", 'estimator = "instrument"')
    yield from ("", "[fit]", "starts = 4", "seed = 1")
    yield from ("", "[verify]", 'initial_state = "estimate"')
    for axis in axes:
        yield from axis.lines()
    if tune:
        yield from ("", "# Gains of the autopilot that flew; docs/tuning.md lists requirements.")
        yield "[tune]"
