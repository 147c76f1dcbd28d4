"""Margins before and after: of two models under one controller, or of two sets of gains."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from operator import methodcaller
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.control.closed_loop.close_loop import close_loop
from flightid.control.loops.interconnection import Interconnection
from flightid.control.margins.gain_limits import loop_numbers, measured_up
from flightid.control.margins.loop_source import BrokenLoop, read_loop
from flightid.control.margins.margins import GAIN_GUIDE_DB, MISSING, Margins, margins_of
from flightid.control.margins.outside_band import outside_band
from flightid.control.stepped.gain_controller import GainController
from flightid.control.stepped.gain_loops import UncertainPlant, gain_loops
from flightid.conventions import Light
from flightid.dynamics.conditions.ratios import SHARED_ERRORS, even_error
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.prediction.remembered import share_samples
from flightid.identification.uncertain_of import source_findings
from flightid.result import Result
from flightid.review.changes import LoopChange, change_of, change_table, significant_of, verdicts
from flightid.table import Table
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.quantiles import two_sided_chance
from flightid.uncertainty.uncertain import Uncertain

Law = GainController | Mapping[str, Mapping[str, float]]
COMPARED = (
    ("crossover", "crossover_rad_s", "rad/s"),
    ("phase margin", "phase_margin_deg", "deg"),
    ("gain margin", "gain_margin_db", "dB"),
    ("gain-reduction margin", "gain_reduction_margin_db", "dB"),
    ("delay margin", "delay_margin_s", "s"),
    ("sensitivity peak", "sensitivity_peak", "1"),
    ("disturbance bandwidth", "disturbance_bandwidth_rad_s", "rad/s"),
)
"""Name, field of `LoopMetrics`, unit."""
FIELDS = [field for _, field, _ in COMPARED]
ONE_MODEL = "Both are of one model, whose errors are common to them: differences hold that."
TWO_MODELS = "Differences take the models' errors as independent: of different flights or records."
ONE_RECORD = (
    "Both models are fitted to one record, whose noise moves both: differences have no interval, "
    "and nothing says which of them are chance."
)


@dataclass(frozen=True, repr=False, eq=False)
class MarginComparison(Result, schema="flightid.margin_comparison/1"):
    """Result of `flightid.compare_margins`.

    Attributes
    ----------
    names : tuple of str
        Before and after.
    changes : tuple of LoopChange
        Of each loop: crossover, phase, gain and delay margins, sensitivity peak, disturbance
        bandwidth.
    before, after : mapping of str to Margins
        By loop.
    one_model : bool
        Whether both are of one model, so that its errors are common to them.
    one_record : bool
        Whether they are of two models that were fitted to the same samples.
    significant : tuple of str
        ``"loop, name"`` of what changed beyond chance.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> yaw = fid.load_model("rate_first_order", axis="yaw")
    >>> found = fid.compare_margins((yaw, {"tau_psi": {"r": 0.1}}), (yaw, {"tau_psi": {"r": 0.2}}))
    >>> found.one_model, len(found.before)
    (True, 1)
    """

    names: tuple[str, str]
    changes: tuple[LoopChange, ...]
    before: Mapping[str, Margins]
    after: Mapping[str, Margins]
    one_model: bool
    one_record: bool
    significant: tuple[str, ...]
    findings: tuple[Finding, ...]

    def __getitem__(self, key: str) -> LoopChange:
        """A change by ``"loop, name"``.

        Raises
        ------
        DataError
            Not both have it.
        """
        for change in self.changes:
            if change.key == key:
                return change
        raise DataError("not both have such a number", found=key)

    def summary(self, level: float | None = None) -> Table:
        """Each number before and after, with the interval of the difference.

        Parameters
        ----------
        level : float, optional
            Of the intervals.
        """
        apart = ONE_RECORD if self.one_record else TWO_MODELS
        notes = (ONE_MODEL if self.one_model else apart, *map(str, self.findings))
        title = f"Margins, {self.names[0]} and {self.names[1]}"
        return change_table(title, self.names, self.changes, self.significant, notes, level)

    def __repr__(self) -> str:
        """Names and number of changes on one line."""
        return (
            f"MarginComparison({' and '.join(self.names)}: {len(self.significant)} of "
            f"{len(self.changes)} numbers changed)"
        )


def compare_margins(
    before: tuple[object, Law],
    after: tuple[object, Law],
    *,
    names: tuple[str, str] = ("before", "after"),
) -> MarginComparison:
    """Compare margins of two loops: of two models, of two sets of gains, or of both.

    Parameters
    ----------
    before, after : tuple of (fit or model, law)
        The law is a mapping of gains by input and output, as `flightid.close_loop` takes it, or the
        controllers of an autopilot's or a PID's gains. One model in both is known as one: the
        errors of its fit are then common, and mostly leave the difference.
    names : tuple of str

    Returns
    -------
    MarginComparison

    Raises
    ------
    DataError
        There is no loop that both have.
    FlightidError
        As `flightid.close_loop` and `flightid.margins`.

    Assumes
    -------
    Two models have independent errors, unless their files say that both were fitted to the same
    samples: there is then no interval of a difference. Nor is there one of a number that is read
    above the band of either fit. Intervals are those of `flightid.margins`: of the estimate's
    covariance, by first order; what a model lacks is not in them. A change is called one by Holm's
    rule: one false verdict in 5 % of comparisons.

    Reference
    ---------
    Zou & Donner, *Statistics in Medicine* 27 (2008), for differences of independent estimates.

    Example
    -------
    >>> import flightid as fid
    >>> yaw = fid.load_model("rate_first_order", axis="yaw")
    >>> found = fid.compare_margins((yaw, {"tau_psi": {"r": 0.1}}), (yaw, {"tau_psi": {"r": 0.2}}))
    >>> found["tau_psi_total / tau_psi, crossover"].difference.value                # doctest: +SKIP
    """
    one_model = before[0] is after[0]
    plants = [UncertainPlant.of(before[0])]
    plants += plants if one_model else [UncertainPlant.of(after[0])]
    pairs = zip((before, after), plants, strict=True)
    old, new = (_loops(source, law, plant) for (source, law), plant in pairs)
    shared = [name for name in old if name in new]
    if not shared:
        raise DataError(
            "there is no loop that both have",
            found=f"{', '.join(old)} and {', '.join(new)}",
            needed="gains around one input of both",
        )
    one_record = not one_model and share_samples(before[0], after[0])
    changes = tuple(
        _shared_errors(change) if one_record else change
        for name in shared
        for change in _changes(name, old[name], new[name], one_model=one_model)
    )
    significant = significant_of(changes)
    told = [{name: margins_of(loops[name]) for name in shared} for loops in (old, new)]
    findings = (
        *verdicts(changes, significant),
        *_doubts(names, (before[0], after[0]), told),
    )
    return MarginComparison(
        names, changes, told[0], told[1], one_model, one_record, significant, findings
    )


def _shared_errors(change: LoopChange) -> LoopChange:
    bare = Estimate(change.difference.name, change.difference.value, change.difference.unit)
    return replace(change, difference=replace(bare, reason=SHARED_ERRORS), chance=None)


def _loops(source: object, law: Law, plant: UncertainPlant) -> Mapping[str, BrokenLoop]:
    if isinstance(law, GainController):
        return gain_loops(plant, law)
    closed = close_loop(source, law, draws=0)
    return {name: _broken(closed.uncertain, name) for name in closed.actuators}


def _broken(closed: Uncertain[Interconnection], actuator: str) -> BrokenLoop:
    """The loop broken at an actuator, the others closed."""
    made = closed.then(methodcaller("broken_at", f"{actuator}_total"))
    return read_loop(
        made, None, None, controller=None, given="broken", band_rad_s=None, unstable_poles=None
    )


def _changes(
    name: str, old: BrokenLoop, new: BrokenLoop, *, one_model: bool
) -> Iterator[LoopChange]:
    """Numbers of a loop before and after, in the order of `COMPARED`."""
    old_rows, new_rows = _rows(old), _rows(new)
    before, after = (
        loop.uncertain.carried_together(rows) for loop, rows in ((old, old_rows), (new, new_rows))
    )
    apart = None
    if one_model:
        both = replace(
            old.uncertain, make=lambda n: (old.uncertain.make(n), new.uncertain.make(n))
        )  # fmt: skip
        apart = both.carried_together(
            lambda pairs: new_rows([b for _, b in pairs]) - old_rows([a for a, _ in pairs])
        )
    outside = [outside_band(loop) for loop in (old, new)]
    for place, (quantity, field, unit) in enumerate(COMPARED):
        one, two = (
            carried.number(place, quantity, unit, MISSING.get(field, "there is none"))
            for carried in (before, after)
        )
        if one.value is None and two.value is None:
            continue
        one, two = (
            found.promised(each, field, GAIN_GUIDE_DB)
            for each, found in zip((one, two), outside, strict=True)
        )
        beyond = any(field in found.above for found in outside)
        if apart is None or beyond or one.value is None or two.value is None:
            yield change_of(name, one, two)
        else:
            difference = apart.number(place, f"{quantity}, difference", unit)
            yield LoopChange(name, quantity, one, two, difference, _chance(difference))


def _rows(loop: BrokenLoop) -> Callable[[list[Any]], NDArray[np.float64]]:
    omega = measured_up(loop)[0]
    return lambda things: loop_numbers(loop, omega, things, FIELDS)[0]


def _chance(difference: Reading) -> float | None:
    """Of so large a difference where the truth is none; None where its error is not known."""
    error = even_error(difference)
    return None if not error else two_sided_chance((difference.value or 0.0) / error)


def _doubts(
    names: Sequence[str], sources: Sequence[object], told: Sequence[Mapping[str, Margins]]
) -> Iterator[Finding]:
    """What is to be doubted of each model and loop, by its name."""
    for name, source, loops in zip(names, sources, told, strict=True):
        own = source_findings(source)
        found = [("", finding) for finding in own]
        found += [
            (f", {loop}", finding)
            for loop, each in loops.items()
            for finding in each.findings
            if finding not in own
        ]
        for where, finding in found:
            if finding.light not in (Light.GREEN, Light.UNKNOWN):
                said = finding.message.removeprefix(f"{where[2:]}: ")
                yield replace(finding, message=f"{name}{where}: {said}")
