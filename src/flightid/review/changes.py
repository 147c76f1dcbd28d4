"""Numbers of loops before and after: their difference with an interval, and what it says."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

from flightid.conventions import Light
from flightid.dynamics.conditions.ratios import chance_of, difference_of, holm
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.review.step_features import BANDWIDTH, GAIN
from flightid.review.tables import by_reason, cell, untold_notes
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import interval_words, shown

TRACKING = "tracking error of set-point"
FREQUENCIES = ("crossover", "disturbance bandwidth")
WORSE = {
    "delay to half": 1.0,
    "rise time": 1.0,
    "overshoot": 1.0,
    BANDWIDTH: -1.0,
    TRACKING: 1.0,
    "crossover": -1.0,
    "phase margin": -1.0,
    "gain margin": -1.0,
    "gain-reduction margin": 1.0,
    "delay margin": -1.0,
    "sensitivity peak": 1.0,
    "disturbance bandwidth": -1.0,
}
"""Which way a number of a loop gets worse; level and gain do away from one."""
MATERIAL_SHARE, MATERIAL_OVERSHOOT = 0.1, 5.0
"""A tenth of what was promised, or five points of overshoot: what no pilot feels is no miss. A
model's simplification alone moves numbers by a few percent, which its covariance does not hold."""
TOLERANCE = f"{100 * MATERIAL_SHARE:g} % of a number, {MATERIAL_OVERSHOOT:g} points of overshoot"
IN_MILLISECONDS = 1e3
MISSED = "promise-missed"
NO_INTERVAL = "the difference has no interval"


@dataclass(frozen=True)
class ExpectedLoop:
    """What models said of one loop under new gains, beside what was flown.

    Attributes
    ----------
    words : mapping of str to str
        Of each number: ``"rise time 0.28 → 0.29 s"``, promised and flown.
    missed : tuple of str
        Numbers that were flown otherwise, beyond chance and by what a pilot feels.
    """

    words: Mapping[str, str]
    missed: tuple[str, ...] = ()


UNPROMISED: Mapping[str, ExpectedLoop] = MappingProxyType({})


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
    def shown_unit(self) -> tuple[float, str]:
        """What numbers are multiplied by for the reader, and the unit that they have then."""
        unit = self.before.unit
        if unit in ("rad", "rad/s") and self.name not in FREQUENCIES:
            return math.degrees(1.0), unit.replace("rad", "deg")
        return (IN_MILLISECONDS, "ms") if unit == "s" else (1.0, "" if unit == "1" else unit)

    @property
    def excludes_zero(self) -> bool:
        """Whether the 95 % interval of the difference, taken alone, leaves zero out."""
        low, high = self.difference.interval(0.95) or (0.0, 0.0)
        return low > 0.0 or high < 0.0

    @property
    def words(self) -> str:
        """Name and both numbers."""
        factor, unit = self.shown_unit
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
        return self.is_material and self._leans_worse

    @property
    def is_slightly_worse(self) -> bool:
        """Whether it went that way by less than a pilot would feel."""
        return not self.is_material and self._leans_worse

    @property
    def _leans_worse(self) -> bool:
        if self.name == "level" or self.name.startswith(GAIN):
            old, new = (abs((each.value or 0.0) - 1.0) for each in (self.before, self.after))
            return new > old
        return WORSE[self.name] * (self.difference.value or 0.0) > 0.0

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        pairs = {key: getattr(self, key).to_dict() for key in ("before", "after", "difference")}
        return {"loop": self.loop, "name": self.name, **pairs, "chance": self.chance}


def change_of(loop: str, before: Reading, after: Reading) -> LoopChange:
    """The change of two independent numbers."""
    apart = difference_of(after, before, f"{before.name}, difference")
    return LoopChange(loop, before.name, before, after, apart, chance_of(after, before))


def significant_of(changes: Iterable[LoopChange]) -> tuple[str, ...]:
    """What changed beyond chance, all judged together by Holm's rule."""
    chances = {c.key: c.chance for c in changes if c.chance is not None}
    kept = holm(chances)
    return tuple(name for name in chances if name in kept)


def change_table(
    title: str,
    names: tuple[str, str],
    changes: Iterable[LoopChange],
    significant: Sequence[str],
    notes: Iterable[str],
    level: float | None,
) -> Table:
    """Each number before and after, with the interval of the difference."""
    chosen = shown(level)
    columns = (
        *(Column("loop"), Column("quantity"), Column("unit"), *map(Column, names)),
        *(Column("difference"), Column("changed")),
    )
    rows: list[tuple[Cell, ...]] = []
    changes = tuple(changes)
    for each in changes:
        factor, unit = each.shown_unit
        told = (cell(number, factor) for number in (each.before, each.after, each.difference))
        said = "yes" if each.key in significant else "" if each.chance is not None else None
        rows.append((each.loop, each.name, unit, *told, said))
    brackets = (
        f"In brackets: {interval_words(chosen)} intervals. Changed: beyond chance, one false "
        "“yes” in 20 such tables."
    )
    return Table(title, columns, tuple(rows), (brackets, *dashes(names, changes), *notes))


def dashes(names: tuple[str, str], changes: Iterable[LoopChange]) -> Iterator[str]:
    """Why cells are dashes: a number that one side does not tell, a difference without a chance.

    Parameters
    ----------
    names : tuple of str
        What the columns before and after are called.
    changes : iterable of LoopChange
    """
    changes = tuple(changes)
    for place, name in enumerate(names):
        sides = ((c.loop, (c.before, c.after)[place]) for c in changes)
        yield from (said.replace("–:", f"– of {name}:", 1) for said in untold_notes(sides))
    unsure = (c for c in changes if c.difference.value is not None and c.chance is None)
    reasons = ((c.loop, c.name, c.difference.reason or NO_INTERVAL) for c in unsure)
    yield from (f"Not judged (–): {said}." for said in by_reason(reasons))


def verdicts(
    changes: Sequence[LoopChange],
    significant: Sequence[str],
    *,
    promised: bool = False,
    bent: Container[str] = (),
    promises: Mapping[str, ExpectedLoop] = UNPROMISED,
) -> Iterator[Finding]:
    """One verdict for each loop that changed, or that none did.

    Loops that are `bent` were moved farther than their controller is proportional to; `promises`
    are of the second of two flights.
    """
    by_loop: dict[str, list[LoopChange]] = {}
    for each in changes:
        if each.key in significant and (each.is_material or not promised):
            by_loop.setdefault(each.loop, []).append(each)
    for loop, found in by_loop.items():
        said = "; ".join(each.words for each in found)
        if promised:
            yield Finding(
                MISSED, Light.AMBER, f"{loop}, promised → flown: {said}: not as promised",
                "look at the steps before you fly more",
            )  # fmt: skip
        else:
            said = f"{loop}, before → after: {said}"
            yield _changed(said, found, promises.get(loop), bent=loop in bent)
    if not any(each.chance is not None for each in changes):
        yield Finding(
            "loops-not-judged", Light.UNKNOWN,
            "no difference has an interval, so nothing says which of them are chance",
            "compare fits or models that know their covariance",
        )  # fmt: skip
    elif not by_loop:
        judged = [c for c in changes if c.chance is not None]
        count = len({c.loop for c in judged})
        said = f"{len(judged)} numbers of {count} loop{'' if count == 1 else 's'}"
        told = "flown as promised" if promised else "no change beyond chance"
        told += f" ({len(changes) - len(judged)} more not judged)" if changes[len(judged) :] else ""
        small = sum(each.key in significant for each in judged)
        if small:
            told += f" but for {small} that changed by less than what counts ({TOLERANCE})"
        told += _alone(judged, significant)
        code = "promise-kept" if promised else "loops-unchanged"
        yield Finding(code, Light.GREEN, f"{said}: {told}")


def _alone(judged: Sequence[LoopChange], significant: Sequence[str]) -> str:
    """Differences beyond their own interval that are none beyond chance among so many."""
    alone = sum(each.excludes_zero for each in judged if each.key not in significant)
    if not alone:
        return ""
    verb, whose = ("is", "its") if alone == 1 else ("are", "their")
    usual = f"chance alone brings {0.05 * len(judged):.2g} of so many"
    return f"; {alone} {verb} beyond {whose} own 95 % interval, where {usual}"


def _changed(
    said: str, found: list[LoopChange], promise: ExpectedLoop | None, *, bent: bool
) -> Finding:
    """Amber where something got worse; not judged by little, by tracking alone, or of large moves.

    A bent loop answers large moves less than in proportion: its step goes by how far it was moved.
    What models promised of the new gains is held against the promise, not against the older gains.
    """
    if bent:
        said += "; moved beyond what its controller is proportional to"
        action = "compare flights whose sticks moved as far: the angle controller answers large "
        return Finding("loop-changed", Light.UNKNOWN, said, action + "moves more slowly than small")
    worse = [each.name for each in found if each.is_worse]
    if promise is not None and (promise.missed or (worse and worse != [TRACKING])):
        return _beside(said, [name for name in worse if name in promise.words], promise)
    if not worse:
        little = [each.name for each in found if each.is_slightly_worse]
        if not little:
            return Finding("loop-changed", Light.GREEN, said)
        said += f"; worse beyond chance, by less than {TOLERANCE}: {', '.join(little)}"
        return Finding("loop-changed", Light.UNKNOWN, said, "weigh it")
    said += f"; worse: {', '.join(worse)}"
    if worse == [TRACKING]:
        action = "compare flights whose sticks moved alike: quicker sticks are tracked worse"
        return Finding("loop-changed", Light.UNKNOWN, said, action)
    action = "look at the loops and at what was set otherwise, and go back unless you wanted it"
    return Finding("loop-changed", Light.AMBER, said, action)


def _beside(said: str, worse: Sequence[str], promise: ExpectedLoop) -> Finding:
    """What got worse beside what was promised of it; where a promise was missed, that one."""
    told = "; ".join(promise.words[name] for name in promise.missed or worse)
    told = f" (promised → flown: {told})" if told else ""
    if not promise.missed:
        said += f": as the models promised of these gains{told}"
        return Finding("loop-as-promised", Light.GREEN, said)
    action = "look at the steps before you fly more, and go back unless you know why"
    said += f": not as the models promised of these gains{told}"
    return Finding("loop-changed", Light.AMBER, said, action)
