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
from flightid.inspection.carried import NOT_SWEPT, why_no_model
from flightid.inspection.log_clock import begins_later
from flightid.inspection.signals import Span
from flightid.inspection.usable_band import AxisBand, hertz_words
from flightid.logs import Log, read_log
from flightid.models.save import toml_value
from flightid.study.proposal.parts import AxisParts, LogPart, axis_parts
from flightid.study.proposal.proposal import Proposal
from flightid.study.stage_runner import StageRunner

TEMPLATES = {"roll": "rate_motor_lag", "pitch": "rate_motor_lag", "yaw": "rate_rotor_inertia"}
"""Rate of a multirotor to its mixer's command; in yaw the rotors' own inertia turns it first."""


@dataclass(frozen=True)
class _Axis:
    """What is identified of one axis."""

    axis: str
    parts: AxisParts
    band_rad_s: Span
    template: str
    found: str

    @property
    def name(self) -> str:
        return f"{self.axis.capitalize()} rate"

    def lines(self) -> Iterator[str]:
        yield from ("", "[[model]]", f"name = {toml_value(self.name)}")
        yield f"template = {toml_value(self.template)}"
        yield f"axis = {toml_value(self.axis)}"
        yield f"identify = {toml_value([each.name for each in self.parts.flown])}"
        if self.parts.unseen:
            yield f"verify = {toml_value([each.name for each in self.parts.unseen])}"
        else:
            yield "# Nothing else moved this axis: fly a doublet, and name its span for verify."
        # Of the log, not of the band below, which a hand may move.
        yield f"# The log carries {hertz_words(self.band_rad_s)}: {self.found}"
        yield f"band_rad_s = {toml_value(list(self.band_rad_s))}"
        if self.template == "rate_motor_lag":
            yield "parameters.T_m = { maximum = 0.15 } # the motor is the faster of the two lags"
        if self.parts.excitations:
            yield "# The chirp is logged, so a controller in the loop does not bias the estimate."
            told = toml_value(list(self.parts.excitations))
            yield f'response = {{ estimator = "instrument", excitations = {told} }}'
        elif self.parts.estimator != "instrument":
            yield "# No injection was logged here: a direct estimate, with the loop's bias in it."
            yield f"response = {{ estimator = {toml_value(self.parts.estimator)} }}"


def _segment(stretch: LogPart) -> Iterator[str]:
    yield from ("", "[[segment]]", f"name = {toml_value(stretch.name)}")
    if stretch.run is not None:
        yield f"sid_axis = {stretch.run.axis}"
        if stretch.number:
            yield f"run = {stretch.number}"
    if stretch.span_s is not None:
        yield f"span_s = {toml_value([round(each, 3) for each in stretch.span_s])}"


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
    if model is None and axes_of(log.vehicle)[axis].command not in COMMANDS:
        return _missed(
            inspection, axis, "there is no usual model of this vehicle's surfaces",
            "name one of the library or of your own: --model short_period",
        )  # fmt: skip
    said = (
        f"coherence {band.coherence:.2f} on average" if band.coherence is not None else "coherent"
    )
    return _Axis(
        axis, axis_parts(log, inspection, axis), band.band_rad_s, model or TEMPLATES[axis],
        f"{said}, inside what was swept",
    )  # fmt: skip


COMMANDS = ("tau_phi", "tau_theta", "tau_psi")
"""Mixer commands of multirotors, which the usual models take."""


def _missed(inspection: Inspection, axis: str, why: str, action: str = "") -> Finding:
    """Why there is no model of an axis; the inspection's advice where there is none of its own.

    That nobody swept an axis is no failure: it is told, and green.
    """
    advice = next((f.action for f in inspection.findings if f.code == "no-excitation"), "")
    failed = why != NOT_SWEPT
    code, light = ("no-model", Light.RED) if failed else ("not-swept", Light.GREEN)
    return Finding(code, light, f"{axis}: no model, {why}", action or advice)


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
        for stretch in (*axis.parts.flown, *axis.parts.unseen):
            yield from _segment(stretch)
            yield from (f"{name} = {toml_value(value)}" for name, value in declared.items())
    if any(axis.parts.estimator == "instrument" for axis in axes):
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
