"""Before and after: loops of two flights, or of a promise and a flight, with their differences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding, said_once, worst_last
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.review.changes import (
    MISSED,
    TRACKING,
    ExpectedLoop,
    LoopChange,
    change_of,
    change_table,
    significant_of,
    verdicts,
)
from flightid.review.flight_state import MOTORS, OTHERS
from flightid.review.loop_response import LoopResponse
from flightid.review.motors import LIMITS
from flightid.review.step_features import BANDWIDTH, GAIN, creep, follows, step_features
from flightid.review.told_band import QUICK, is_too_quick
from flightid.table import Column, Table
from flightid.uncertainty.estimate import Reading

Array = NDArray[np.float64]
SHOWN = ("delay to half", "rise time", "overshoot", "level")
NOT_ALIKE = "not-alike"
STEPS = "Steps of both are read over the time that both show"
REACHED = "level and delay are of what is reached in it, no rise time is told that goes by its end"
NO_MODEL = "none of them is of its rate"
NOT_ALONE = "its set-point acts by more than the angle controller"
OTHER_FILTERS = "other-filters"
CAUSES = (NOT_ALIKE, OTHER_FILTERS, *LIMITS)
"""Findings that excuse a loop, and say nothing of it."""
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
        What else differs that loops depend on: vehicle, board, firmware, frame, motors, battery.
    significant : tuple of str
        ``"loop, name"`` of what changed beyond chance.
    findings : tuple of Finding
    beside : str
        What is to be known of what was not looked at; empty where nothing is.

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
    beside: str = ""

    @property
    def kept(self) -> bool | None:
        """Whether no loop was found that asks for a look; None where a part was not judged."""
        lights = {each.light for each in self.findings if each.code not in CAUSES}
        if lights & {Light.AMBER, Light.RED}:
            return False
        return None if Light.UNKNOWN in lights else True

    @property
    def set_otherwise(self) -> tuple[str, ...]:
        """What a promise rests on that was set otherwise in the flight: filters, motors' curve."""
        curve = (MOTORS,) if MOTORS in self.unlike else ()
        return (*self.filters, *curve) if self.promised else ()

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
        beside = filter(None, (self.beside,))
        notes = (*self._windows(), *beside, *map(str, said_once(worst_last(self.findings))))
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
        if moving := [a.name for a, b in pairs if _unsettled(a, b, min(ends[a.name]))]:
            yield f"Not settled in that time: {', '.join(moving)}; {REACHED}."
        yield from self.left_out
        if any(each.name == TRACKING for each in self.changes):
            yield (
                "Tracking error: rms of the error over that of the set-point; it depends on how "
                "fast the sticks moved too."
            )

    @property
    def left_out(self) -> tuple[str, ...]:
        """Sentences on loops that one of both alone tells, and why the other does not."""
        return tuple(self._alone())

    def _alone(self) -> Iterator[str]:
        compared = {each.loop for each in self.changes}
        names = dict.fromkeys(each.name for each in (*self.before, *self.after))
        for place, loops in enumerate((self.before, self.after)):
            told = {loop.name: loop for loop in loops}
            missing = [n for n in names if n not in compared and n not in told]
            if self.promised and place == 0:
                for name in missing:
                    why = NOT_ALONE if f"{name.split()[0]} rate" in told else NO_MODEL
                    yield f"The models promise nothing of {name}: {why}."
            elif missing:
                yield f"{self.names[place]} logs no set-point of {', '.join(missing)}."
            for name in names:
                if name in told and name not in compared and not told[name].is_told:
                    yield f"{self.names[place]} does not tell {name}: {told[name].reason}."

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
    promise: FlightComparison | None = None,
    limits: tuple[Finding, ...] = (),
) -> FlightComparison:
    """Put the loops of two flights, or of a promise and a flight, side by side.

    Where a `promise` of the second flight is known, what got worse is held against that. Of other
    vehicles, and of loops that `limits` bent, no difference praises what was set, and no likeness.
    """
    bent = {loop.name: loop for loop in (*before, *after) if loop.is_bent and loop.is_told}
    later = {loop.name: loop for loop in after if not (promised and loop.is_bent)}
    changes = tuple(
        change_of(loop.name, reading, answer)
        for loop in before
        if loop.name in later and loop.is_told and later[loop.name].is_told
        for reading, answer in pairs(loop, later[loop.name])
    )
    if not changes:
        sides = zip(names, (before, after), strict=True)
        reasons = (_untold(name, loops) for name, loops in sides)
        untold = "; ".join(filter(None, (_apart(unlike), *reasons)))
        raise DataError(
            "there is no loop that both tell",
            found=untold or "no loop in common",
            needed="the step of one loop in both",
            action="see flightid flight LOG of each for what to fly",
        )
    kept = significant_of(changes)
    promises = expected(promise)
    judged = list(verdicts(changes, kept, promised=promised, bent=bent, promises=promises))
    if limits or any(each in unlike for each in OTHERS):
        judged = [replace(e, light=Light.UNKNOWN) if e.light is Light.GREEN else e for e in judged]
    unfit = [bent[loop.name] for loop in before if promised and loop.name in bent]
    said = list(_unlike(unlike, names, promised=promised))
    if promised and filters:
        said.append(_other_filters(filters, names))
    findings = (*said, *limits, *judged, *map(_beyond, unfit))
    made = FlightComparison(
        names, promised, changes, before, after, gains, filters, unlike, kept, findings
    )
    excused = tuple(_excused(each, made.set_otherwise) for each in findings)
    return replace(made, findings=excused) if made.set_otherwise else made


def _untold(name: str, loops: Iterable[LoopResponse]) -> str:
    """Why a side tells no loops, each reason once; empty where it tells all."""
    reasons: dict[str, list[str]] = {}
    for loop in loops:
        if loop.reason:
            reasons.setdefault(loop.reason, []).append(loop.name)
    if len(reasons) == 1:
        return f"{name}: {next(iter(reasons))}"
    told = "; ".join(f"{', '.join(names)}: {reason}" for reason, names in reasons.items())
    return f"{name}: {told}" if told else ""


def pairs(before: LoopResponse, after: LoopResponse) -> Iterator[tuple[Reading, Reading]]:
    """The same number of both, steps read over the time that both show: where they end counts.

    Overshoots are of what is asked where both follow it, of their own levels else. Where one flight
    does not tell a number, the other's stands beside a gap.
    """
    end_s = min(before.time_s[-1], after.time_s[-1])
    steps = [_until(loop, end_s) for loop in (before, after)]
    of_asked = all(follows(*each) for each in steps)
    old, new = (
        _readings(loop, step_features(*step, of_asked=of_asked))
        for loop, step in zip((before, after), steps, strict=True)
    )
    for name, reading in old.items():
        answer = new.get(name)
        if answer is not None and (reading.value is not None or answer.value is not None):
            yield reading, answer


def _readings(loop: LoopResponse, step: tuple[Reading, ...]) -> dict[str, Reading]:
    """Of what a step reaches in some time, whether it has settled there or not, and the rest."""
    found = {r.name: r for r in step if r.name in SHOWN}
    found |= {r.name: r for r in loop.readings if r.name.startswith((GAIN, BANDWIDTH))}
    found |= {r.name: r for r in loop.readings if r.name == QUICK[0] and is_too_quick(r)}
    if loop.tracking is not None and loop.asked:
        found[TRACKING] = loop.tracking.scaled(100.0 / loop.asked, name=TRACKING, unit="%")
    return found


def _until(loop: LoopResponse, end_s: float) -> tuple[Array, Array]:
    kept = loop.time_s <= end_s
    return np.vstack([loop.step, loop.draws])[:, kept], loop.time_s[kept]


def _unsettled(one: LoopResponse, other: LoopResponse, end_s: float) -> bool:
    return any(creep(_until(each, end_s)[0]) for each in (one, other))


def expected(promise: FlightComparison | None) -> dict[str, ExpectedLoop]:
    """What models promised of each loop of a flight that it is held against."""
    found: dict[str, list[LoopChange]] = {}
    if promise is not None and promise.set_otherwise:
        promise = None  # Made for other settings, it excuses nothing and accuses nobody.
    for each in () if promise is None else promise.changes:
        if each.chance is not None:
            found.setdefault(each.loop, []).append(each)
    missed = () if promise is None else promise.significant
    return {
        loop: ExpectedLoop(
            {each.name: each.words for each in changes},
            tuple(each.name for each in changes if each.key in missed and each.is_material),
        )
        for loop, changes in found.items()
    }


def unheld(promise: FlightComparison) -> tuple[Finding, ...]:
    """What a promise was not held against, with what to fly for it, or why it was not."""
    return tuple(
        each
        for each in promise.findings
        if each.light is Light.UNKNOWN or each.code == OTHER_FILTERS
    )


def _beyond(loop: LoopResponse) -> Finding:
    """That a promise, which is of small moves, is not held against large ones."""
    said = f"{loop.name}: not compared with what was promised of small moves: {loop.beyond}"
    return Finding("beyond-angle-law", Light.UNKNOWN, said, f"{loop.action}, and compare again")


def _other_filters(filters: Mapping[str, tuple[str, str]], names: tuple[str, str]) -> Finding:
    """That a promise was made for filters that the flight did not have."""
    said = f"{names[0]} promise of other filters than {names[1]} flew: {_apart(filters)}"
    action = (
        f"set {', '.join(filters)} as it was promised for, or sweep with the new: flightid plan"
    )
    return Finding(OTHER_FILTERS, Light.AMBER, said, f"{action} {names[1]}")


def _excused(found: Finding, otherwise: tuple[str, ...]) -> Finding:
    """A missed promise that was made for other settings: not judged."""
    if found.code != MISSED:
        return found
    said = f"{found.message} of other settings ({', '.join(otherwise)})"
    return replace(found, light=Light.UNKNOWN, message=said, action="")


def _apart(unlike: Mapping[str, tuple[str, str]]) -> str:
    return "; ".join(f"{what} {old} → {new}" for what, (old, new) in unlike.items())


def _unlike(
    unlike: Mapping[str, tuple[str, str]], names: tuple[str, str], *, promised: bool
) -> Iterator[Finding]:
    if not unlike:
        return
    said = _apart(unlike)
    if not promised:
        yield Finding(
            NOT_ALIKE, Light.AMBER, f"more than gains may differ between the two logs: {said}",
            "compare flights of one vehicle in one state, or hold these for causes as well",
        )  # fmt: skip
    elif "vehicle" in unlike or "frame" in unlike:
        yield Finding(
            NOT_ALIKE, Light.RED, f"{names[0]} are of another vehicle than {names[1]}: {said}",
            f"name the study of this vehicle, or make one: flightid plan {names[1]}",
        )  # fmt: skip
    else:
        yield Finding(
            NOT_ALIKE, Light.AMBER, f"{names[0]} are of a flight in another state: {said}",
            "hold these for causes as well where a promise is missed",
        )  # fmt: skip
