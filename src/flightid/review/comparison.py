"""Before and after: loops of two flights, or of a promise and a flight, with their differences."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from flightid.conventions import Light
from flightid.dynamics.conditions.ratios import chance_of, difference_of, holm
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.result import Result
from flightid.review.loop_response import LoopResponse
from flightid.review.step_features import step_features
from flightid.review.tables import cell
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import interval_words, shown

SHOWN = ("delay to half", "rise time", "overshoot", "level")
BY_FREQUENCY, TRACKING = "bandwidth at -3 dB", "tracking error of set-point"
WORSE = {
    "delay to half": 1.0,
    "rise time": 1.0,
    "overshoot": 1.0,
    BY_FREQUENCY: -1.0,
    TRACKING: 1.0,
}
"""Which way a number of a loop gets worse."""
STEPS = "Steps of both are read over the time that both show"
MATERIAL_SHARE, MATERIAL_OVERSHOOT = 0.1, 5.0
"""A tenth of what was promised, or five points of overshoot: what no pilot feels is no miss. A
model's simplification alone moves numbers by a few percent, which its covariance does not hold."""
IN_MILLISECONDS = 1e3
NONE: Mapping[str, tuple[Any, Any]] = MappingProxyType({})


@dataclass(frozen=True)
class LoopChange:
    """One number of one loop, before and after.

    Attributes
    ----------
    loop, name : str
        ``"roll rate"``; ``"rise time"``.
    before, after, difference : Estimate
        The last has an interval where both have.
    chance : float or None
        Of so large a difference between equal truths.
    """

    loop: str
    name: str
    before: Reading
    after: Reading
    difference: Reading
    chance: float | None

    @property
    def key(self) -> str:
        """Loop and name: ``"roll rate, rise time"``."""
        return f"{self.loop}, {self.name}"

    @property
    def words(self) -> str:
        """Name and both numbers."""
        factor, unit = _shown_unit(self.before.unit)
        old, new = (factor * (each.value or 0.0) for each in (self.before, self.after))
        return f"{self.name} {old:.3g} → {new:.3g}{unit and ' ' + unit}"

    @property
    def is_material(self) -> bool:
        """Whether a pilot would feel it."""
        old, apart = self.before.value or 0.0, abs(self.difference.value or 0.0)
        if self.name == "overshoot":
            return apart >= MATERIAL_OVERSHOOT
        return apart >= MATERIAL_SHARE * abs(old)

    @property
    def is_worse(self) -> bool:
        """Whether a pilot would feel it, and would rather not: slower, or less true."""
        if self.name == "level":
            old, new = (abs((each.value or 0.0) - 1.0) for each in (self.before, self.after))
            return self.is_material and new > old
        return self.is_material and WORSE[self.name] * (self.difference.value or 0.0) > 0.0

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        pairs = {key: getattr(self, key).to_dict() for key in ("before", "after", "difference")}
        return {"loop": self.loop, "name": self.name, **pairs, "chance": self.chance}


@dataclass(frozen=True, repr=False, eq=False)
class FlightComparison(Result, schema="flightid.flight_comparison/1"):
    """Result of `flightid.compare_flights`.

    Attributes
    ----------
    names : tuple of str
        Before and after.
    promised : bool
        Whether the first is a model's promise of the second's loops.
    changes : tuple of LoopChange
    before, after : tuple of LoopResponse
    gains : mapping of str to tuple of float
        Parameters that differ: before and after.
    filters : mapping of str to tuple of str
        Filters whose settings differ: before and after.
    unlike : mapping of str to tuple of str
        What else differs that loops depend on: vehicle, firmware, frame, battery.
    significant : tuple of str
        ``"loop, name"`` of what changed beyond chance.
    findings : tuple of Finding

    Example
    -------
    >>> found = fid.compare_flights("before.BIN", "after.BIN")        # doctest: +SKIP
    >>> print(found.summary())                                        # doctest: +SKIP
    """

    names: tuple[str, str]
    promised: bool
    changes: tuple[LoopChange, ...]
    before: tuple[LoopResponse, ...]
    after: tuple[LoopResponse, ...]
    gains: Mapping[str, tuple[float, float]]
    filters: Mapping[str, tuple[str, str]]
    unlike: Mapping[str, tuple[str, str]]
    significant: tuple[str, ...]
    findings: tuple[Finding, ...]

    @property
    def kept(self) -> bool:
        """Whether nothing was found that asks for a look."""
        return all(each.light is Light.GREEN for each in self.findings)

    def __getitem__(self, name: str) -> LoopChange:
        """A change by ``"roll rate, rise time"``.

        Raises
        ------
        DataError
            Not both tell it.
        """
        for change in self.changes:
            if change.key == name:
                return change
        raise DataError("not both tell such a number", found=name)

    def summary(self, level: float | None = None) -> Table:
        """Each number before and after, with the interval of the difference.

        Parameters
        ----------
        level : float, optional
            Of the intervals.
        """
        chosen = shown(level)
        first, second = ("promised", "flown") if self.promised else self.names
        columns = (
            *(Column("loop"), Column("quantity"), Column("unit"), Column(first), Column(second)),
            *(Column("difference"), Column("changed")),
        )
        rows: list[tuple[Cell, ...]] = []
        for each in self.changes:
            factor, unit = _shown_unit(each.before.unit)
            apart, changed = each.difference, each.key in self.significant
            rows.append(
                (
                    *(each.loop, each.name, unit, cell(each.before, factor)),
                    *(cell(each.after, factor), cell(apart, factor), "yes" if changed else ""),
                )
            )
        notes = (
            f"In brackets: {interval_words(chosen)} intervals. Changed: beyond chance, one false "
            "“yes” in 20 such tables.",
            *self._windows(),
            *map(str, self.findings),
        )
        title = f"{self.names[0]} and {self.names[1]}"
        if self.unlike:
            title = f"{title}, of different {', '.join(self.unlike)}"
        return Table(title, columns, tuple(rows), notes)

    def _windows(self) -> Iterator[str]:
        """That steps are read otherwise than each flight's own, and what tracking depends on."""
        later = {loop.name: loop for loop in self.after}
        told = dict.fromkeys(each.loop for each in self.changes)
        pairs = [(loop, later[loop.name]) for loop in self.before if loop.name in told]
        ends = {a.name: [each.time_s[-1] for each in (a, b)] for a, b in pairs}
        cut = [f"{n}: {min(e):.2g} s" for n, e in ends.items() if max(e) > 1.001 * min(e)]
        if cut:
            alone = "" if self.promised else "; flightid flight reads each over its own"
            yield f"{STEPS} ({'; '.join(cut)}){alone}."
        if any(each.name == TRACKING for each in self.changes):
            yield (
                "Tracking error: rms of the error over that of the set-point; it depends on how "
                "fast the sticks moved too."
            )

    def gains_table(self) -> Table:
        """Parameters that differ."""
        rows = tuple(
            (name, old, new, new / old if old else None) for name, (old, new) in self.gains.items()
        )
        columns = (
            *(Column("parameter"), Column(self.names[0], digits=5)),
            *(Column(self.names[1], digits=5), Column("ratio", digits=3)),
        )
        return Table("Gains that differ", columns, rows)

    def filters_table(self) -> Table:
        """Filters whose settings differ."""
        rows = tuple((name, *settings) for name, settings in self.filters.items())
        columns = Column("filter"), Column(self.names[0]), Column(self.names[1])
        return Table("Filters that differ", columns, rows)

    def settings_tables(self) -> tuple[Table, ...]:
        """What was set otherwise: gains, filters; those that have rows."""
        return tuple(t for t in (self.gains_table(), self.filters_table()) if t.rows)

    def _tables(self) -> tuple[Table, ...]:
        return (*self.settings_tables(), self.summary())

    def __repr__(self) -> str:
        """Names and number of changes on one line."""
        return (
            f"FlightComparison({' and '.join(self.names)}: {len(self.significant)} of "
            f"{len(self.changes)} numbers changed)"
        )


def compare_loops(
    before: tuple[LoopResponse, ...],
    after: tuple[LoopResponse, ...],
    names: tuple[str, str],
    *,
    gains: Mapping[str, tuple[float, float]] = NONE,
    filters: Mapping[str, tuple[str, str]] = NONE,
    unlike: Mapping[str, tuple[str, str]] = NONE,
    promised: bool,
) -> FlightComparison:
    """Put the loops of two flights, or of a promise and a flight, side by side."""
    later = {loop.name: loop for loop in after}
    changes = tuple(
        _change(loop.name, reading, answer)
        for loop in before
        if loop.name in later and loop.is_told and later[loop.name].is_told
        for reading, answer in _pairs(loop, later[loop.name])
    )
    if not changes:
        untold = "; ".join(
            f"{loop.name}: {loop.reason}" for loop in (*before, *after) if loop.reason
        )
        raise DataError(
            "there is no loop that both tell",
            found=untold or "no loop in common",
            needed="the step of one loop in both",
            action="see flightid flight LOG of each for what to fly",
        )
    chances = {c.key: c.chance for c in changes if c.chance is not None}
    significant = holm(chances)
    kept = tuple(name for name in chances if name in significant)
    findings = (*_unlike(unlike), *_judged(changes, kept, promised=promised))
    return FlightComparison(
        names, promised, changes, before, after, gains, filters, unlike, kept, findings
    )


def _pairs(before: LoopResponse, after: LoopResponse) -> Iterator[tuple[Reading, Reading]]:
    """The same number of both, steps read over the time that both show: where they end counts."""
    end_s = min(before.time_s[-1], after.time_s[-1])
    old, new = _readings(before, end_s), _readings(after, end_s)
    for name, reading in old.items():
        answer = new.get(name)
        if answer is not None and reading.value is not None and answer.value is not None:
            yield reading, answer


def _readings(loop: LoopResponse, end_s: float) -> dict[str, Reading]:
    kept = loop.time_s <= end_s
    steps = np.vstack([loop.step, loop.draws])[:, kept]
    found = {r.name: r for r in step_features(steps, loop.time_s[kept]) if r.name in SHOWN}
    found |= {r.name: r for r in loop.readings if r.name == BY_FREQUENCY}
    if loop.tracking is not None and loop.tracking.value is not None and loop.moved:
        found[TRACKING] = loop.tracking.scaled(100.0 / loop.moved, name=TRACKING, unit="%")
    return found


def _change(loop: str, before: Reading, after: Reading) -> LoopChange:
    apart = difference_of(after, before, f"{before.name}, difference")
    return LoopChange(loop, before.name, before, after, apart, chance_of(after, before))


def _shown_unit(unit: str) -> tuple[float, str]:
    if unit in ("rad", "rad/s"):
        return math.degrees(1.0), unit.replace("rad", "deg")
    return (IN_MILLISECONDS, "ms") if unit == "s" else (1.0, "" if unit == "1" else unit)


def _unlike(unlike: Mapping[str, tuple[str, str]]) -> Iterator[Finding]:
    if unlike:
        said = "; ".join(f"{what} {old} → {new}" for what, (old, new) in unlike.items())
        yield Finding(
            "not-alike", Light.AMBER, f"more than gains may differ between the two logs: {said}",
            "compare flights of one vehicle in one state, or hold these for causes as well",
        )  # fmt: skip


def _judged(
    changes: tuple[LoopChange, ...], significant: tuple[str, ...], *, promised: bool
) -> Iterator[Finding]:
    by_loop: dict[str, list[LoopChange]] = {}
    for each in changes:
        if each.key in significant and (each.is_material or not promised):
            by_loop.setdefault(each.loop, []).append(each)
    for loop, found in by_loop.items():
        said = "; ".join(each.words for each in found)
        if promised:
            yield Finding(
                "promise-missed", Light.AMBER, f"{loop}, promised → flown: {said}",
                "look at the steps before you fly more",
            )  # fmt: skip
        else:
            yield _changed(f"{loop}, before → after: {said}", found)
    if not by_loop:
        said = f"{len(changes)} numbers of {len({c.loop for c in changes})} loops"
        yield Finding(
            "promise-kept" if promised else "loops-unchanged", Light.GREEN,
            f"{said}: {'flown as promised' if promised else 'no change beyond chance'}",
        )  # fmt: skip


def _changed(said: str, found: list[LoopChange]) -> Finding:
    """Amber where something got worse; not judged where the tracking error alone did."""
    worse = [each.name for each in found if each.is_worse]
    if not worse:
        return Finding("loop-changed", Light.GREEN, said)
    if worse == [TRACKING]:
        action = "compare flights whose sticks moved alike: quicker sticks are tracked worse"
        return Finding("loop-changed", Light.UNKNOWN, said, action)
    action = f"worse: {', '.join(worse)}; look at the steps and at what was set otherwise, and go "
    return Finding("loop-changed", Light.AMBER, said, action + "back unless you wanted it")
