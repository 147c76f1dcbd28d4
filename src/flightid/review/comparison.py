"""Before and after: loops of two flights, or of a promise and a flight, with their differences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.review.changes import (
    BY_FREQUENCY,
    TRACKING,
    LoopChange,
    change_of,
    change_table,
    significant_of,
    verdicts,
)
from flightid.review.loop_response import LoopResponse
from flightid.review.step_features import step_features
from flightid.table import Column, Table
from flightid.uncertainty.estimate import Reading

SHOWN = ("delay to half", "rise time", "overshoot", "level")
STEPS = "Steps of both are read over the time that both show"
NONE: Mapping[str, tuple[Any, Any]] = MappingProxyType({})


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
    def kept(self) -> bool | None:
        """Whether nothing was found that asks for a look; None where a part was not judged."""
        lights = {each.light for each in self.findings}
        if lights & {Light.AMBER, Light.RED}:
            return False
        return None if Light.UNKNOWN in lights else True

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
        names = ("promised", "flown") if self.promised else self.names
        notes = (*self._windows(), *map(str, self.findings))
        title = f"{self.names[0]} and {self.names[1]}"
        if self.unlike:
            title = f"{title}, of different {', '.join(self.unlike)}"
        return change_table(title, names, self.changes, self.significant, notes, level)

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
        if left := self._left_out():
            yield f"Not compared: {left}."
        if any(each.name == TRACKING for each in self.changes):
            yield (
                "Tracking error: rms of the error over that of the set-point; it depends on how "
                "fast the sticks moved too."
            )

    def _left_out(self) -> str:
        """Loops that one of both alone tells, and why."""
        compared = {each.loop for each in self.changes}
        sides = dict(zip(("promised", "flown") if self.promised else self.names,
                         (self.before, self.after), strict=True))  # fmt: skip
        found: dict[str, list[str]] = {}
        for side, loops in sides.items():
            told = {loop.name: loop for loop in loops}
            for name in dict.fromkeys(each.name for each in (*self.before, *self.after)):
                if name not in compared and (name not in told or not told[name].is_told):
                    why = told[name].reason if name in told else "nothing of it"
                    found.setdefault(name, []).append(f"{side}: {why}")
        return "; ".join(f"{name} ({', '.join(why)})" for name, why in found.items())

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
    bent = {loop.name: loop for loop in (*before, *after) if loop.is_bent and loop.is_told}
    later = {loop.name: loop for loop in after if not (promised and loop.is_bent)}
    changes = tuple(
        change_of(loop.name, reading, answer)
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
    kept = significant_of(changes)
    judged = list(verdicts(changes, kept, promised=promised, bent=bent))
    if "vehicle" in unlike or "frame" in unlike:
        # Of two vehicles no difference praises what was set, and no likeness either.
        judged = [replace(e, light=Light.UNKNOWN) if e.light is Light.GREEN else e for e in judged]
    unfit = [bent[loop.name] for loop in before if promised and loop.name in bent]
    findings = (*_unlike(unlike), *judged, *map(_beyond, unfit))
    return FlightComparison(
        names, promised, changes, before, after, gains, filters, unlike, kept, findings
    )


def _pairs(before: LoopResponse, after: LoopResponse) -> Iterator[tuple[Reading, Reading]]:
    """The same number of both, steps read over the time that both show: where they end counts.

    Where one flight does not tell it, the other's stands beside a gap.
    """
    end_s = min(before.time_s[-1], after.time_s[-1])
    old, new = _readings(before, end_s), _readings(after, end_s)
    for name, reading in old.items():
        answer = new.get(name)
        if answer is not None and (reading.value is not None or answer.value is not None):
            yield reading, answer


def _readings(loop: LoopResponse, end_s: float) -> dict[str, Reading]:
    kept = loop.time_s <= end_s
    steps = np.vstack([loop.step, loop.draws])[:, kept]
    found = {r.name: r for r in step_features(steps, loop.time_s[kept]) if r.name in SHOWN}
    found |= {r.name: r for r in loop.readings if r.name == BY_FREQUENCY}
    if loop.tracking is not None and loop.moved:
        found[TRACKING] = loop.tracking.scaled(100.0 / loop.moved, name=TRACKING, unit="%")
    return found


def _beyond(loop: LoopResponse) -> Finding:
    """That a promise, which is of small moves, is not held against large ones."""
    said = f"{loop.name}: not compared with what was promised of small moves: {loop.beyond}"
    return Finding("beyond-angle-law", Light.UNKNOWN, said, f"{loop.action}, and compare again")


def _unlike(unlike: Mapping[str, tuple[str, str]]) -> Iterator[Finding]:
    if unlike:
        said = "; ".join(f"{what} {old} → {new}" for what, (old, new) in unlike.items())
        yield Finding(
            "not-alike", Light.AMBER, f"more than gains may differ between the two logs: {said}",
            "compare flights of one vehicle in one state, or hold these for causes as well",
        )  # fmt: skip
