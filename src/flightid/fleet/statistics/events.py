"""Events at known times, such as a new motor: what each changed, with its interval.

What an event explains is no change to look for: its step stands in the design at an unknown size,
which leaves what is beyond it to be judged.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.few_days import beside_spread
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.largest_step import SHORTEST
from flightid.fleet.statistics.neighbours import histories_in_time
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Interval, Reading
from flightid.uncertainty.quantiles import half_width, two_sided_chance

Array = NDArray[np.float64]
OPEN = 1e6
"""Variance of a step of which nothing is known, in variances of the least sure flight."""
FEW = "no flight before the event, or none behind it"


@dataclass(frozen=True)
class FleetEvent:
    """Something that was done to vehicles.

    Attributes
    ----------
    what : str
        In words, such as ``"motor replaced"``.
    time_s : float
        When, on the clock of the flights.
    vehicles : tuple of str
        To which; empty: to all.

    Example
    -------
    >>> FleetEvent("motor replaced", 0.0, ("a",)).concerns("b")
    False
    """

    what: str
    time_s: float
    vehicles: tuple[str, ...] = ()

    def concerns(self, vehicle: str) -> bool:
        """Whether it was done to a vehicle."""
        return not self.vehicles or vehicle in self.vehicles


def event_names(events: Sequence[FleetEvent]) -> str:
    """What was done, each once, in quotation marks.

    Example
    -------
    >>> event_names([FleetEvent(what, 0.0) for what in ("motor", "board", "motor")])
    '“motor” and “board”'
    """
    *first, last = (f"“{each}”" for each in dict.fromkeys(one.what for one in events))
    return f"{', '.join(first)} and {last}" if first else last


@dataclass(frozen=True)
class EventEffect:
    """What one event, or several together, did to one parameter of one vehicle.

    Attributes
    ----------
    events : tuple of FleetEvent
        In time. Several where the vehicle did not fly between them, which leaves one step of all;
        or too little to tell them apart surely: then each has an effect of its own beside this one.
    between : int
        Flights between the first and the last of them.
    change : Estimate
        Level behind all less the level before any, in the parameter's unit.
    percent : Estimate
        The same of the level before; the error of that level is in its interval.
    chance : float or None
        Chance of a change as large were there none.
    """

    events: tuple[FleetEvent, ...]
    between: int
    change: Reading
    percent: Reading
    chance: float | None

    @property
    def names(self) -> tuple[str, ...]:
        """What was done, each once."""
        return tuple(dict.fromkeys(each.what for each in self.events))

    @property
    def what(self) -> str:
        """The same as words of a sentence, each in quotation marks."""
        return event_names(self.events)

    @property
    def together(self) -> str:
        """Why several share one change; empty for one."""
        if len(self.names) == 1:
            return ""
        if not self.between:
            return "no flight between them tells them apart"
        flights = "1 flight lies" if self.between == 1 else f"{self.between} flights lie"
        return f"of all together: {flights} between them"


@dataclass(frozen=True, eq=False)
class PercentEnds:
    """Ends of a step in percent of the level before it; they hold zero where those of the step do.

    None where the level may be zero.

    Attributes
    ----------
    level, step : float
    errors : ndarray, shape (2, 2)
        Covariance of both.
    freedom : float

    Reference
    ---------
    Fieller, "Some problems in interval estimation", *J. Royal Statistical Society B* 16 (1954).

    Example
    -------
    >>> low, high = PercentEnds(10.0, 2.1, np.array([[1.0, -1.0], [-1.0, 1.1]]), np.inf)(0.95)
    >>> round(low, 1), round(high, 1)
    (0.4, 51.3)
    """

    level: float
    step: float
    errors: Array
    freedom: float

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        wide = half_width(level, self.freedom) ** 2
        a = self.level**2 - wide * self.errors[0, 0]
        if a <= 0.0:
            return None
        b = self.level * self.step - wide * self.errors[0, 1]
        c = self.step**2 - wide * self.errors[1, 1]
        root = np.sqrt(max(b**2 - a * c, 0.0))
        low, high = sorted(100.0 * np.sign(self.level) * np.array([b - root, b + root]) / a)
        return float(low), float(high)


def event_effect(
    events: tuple[FleetEvent, ...],
    name: str,
    unit: str,
    values: Array,
    covariance: Array,
    time_s: Array,
    freedom: float = np.inf,
) -> EventEffect:
    """Estimate the step of a series at a known time, by generalised least squares.

    Parameters
    ----------
    events : tuple of FleetEvent
        One, or several in time: flights between these are the level before, where `covariance`
        does not leave them open.
    name, unit : str
        Of the parameter.
    values : ndarray, shape (n,)
    covariance : ndarray, shape (n, n)
    time_s : ndarray, shape (n,)
    freedom : float
        Of the variances; infinite where they are known.

    Returns
    -------
    EventEffect

    Assumes
    -------
    The level before stays, and so does the one behind.

    Example
    -------
    >>> motor = FleetEvent("motor replaced", 1.5)
    >>> event_effect((motor,), "gain", "1", np.array([2.0, 2.0, 3.0, 3.0]), 0.01 * np.eye(4),
    ...              np.arange(4.0)).percent
    Estimate(gain = 50 (38.18 to 63.27) %)
    """
    begun, behind = (time_s >= each.time_s for each in (events[0], events[-1]))
    between = int(np.count_nonzero(begun)) - int(np.count_nonzero(behind))
    if begun.all() or not behind.any():
        none: Reading = Estimate(name, None, unit, reason=FEW)
        return EventEffect(events, between, none, Estimate(name, None, "%", reason=FEW), None)
    design = np.column_stack([np.ones(len(values)), behind])
    weighed = np.linalg.solve(covariance, design)
    errors = np.linalg.inv(design.T @ weighed)
    level, step = errors @ (weighed.T @ values)
    stderr = float(np.sqrt(errors[1, 1]))
    percent: Reading = Estimate(name, None, "%", reason="the level before may be zero")
    if abs(level) > 3.0 * np.sqrt(errors[0, 0]):
        ends = PercentEnds(level, step, errors, freedom)
        percent = Estimate(name, float(100.0 * step / abs(level)), "%", ends=ends)
    told = None if np.isinf(freedom) else freedom
    change = Estimate(name, float(step), unit, stderr, freedom=told)
    chance = beside_spread(two_sided_chance(step / stderr), freedom)
    return EventEffect(events, between, change, percent, chance)


def event_effects(
    events: Sequence[FleetEvent],
    name: str,
    unit: str,
    values: Array,
    covariance: Array,
    time_s: Array,
    shared: Array,
    freedom: float = np.inf,
) -> tuple[EventEffect, ...]:
    """The step at each event as `event_effect` has it, those of the others left open.

    Events without a flight between them have one step; those with few have one more of all
    together. What was done to all vehicles is in what they share, which `values` lack.
    """
    known = event_steps(events, time_s)
    found = []
    for asked in asked_together(events, time_s):
        around = opened(covariance, _beside(asked, known, time_s))
        own = values if all(each.vehicles for each in asked) else values + shared
        found.append(event_effect(asked, name, unit, own, around, time_s, freedom))
    return tuple(found)


def asked_together(events: Sequence[FleetEvent], time_s: Array) -> Iterator[tuple[FleetEvent, ...]]:
    """Events of one vehicle as they are asked about, in time.

    Parameters
    ----------
    events : sequence of FleetEvent
    time_s : ndarray, shape (n,)
        Of its flights.

    Yields
    ------
    tuple of FleetEvent
        Those between which it did not fly; then, where `SHORTEST` flights do not lie between
        neighbours, all of these.

    Example
    -------
    >>> happened = [FleetEvent(what, at) for what, at in (("a", 3.5), ("b", 3.6), ("c", 4.5))]
    >>> [[e.what for e in each] for each in asked_together(happened, np.arange(9.0))]
    [['a', 'b'], ['c'], ['a', 'b', 'c']]
    """
    apart: dict[int, list[FleetEvent]] = {}
    for event in sorted(events, key=lambda each: each.time_s):
        apart.setdefault(int(np.count_nonzero(time_s >= event.time_s)), []).append(event)
    yield from map(tuple, apart.values())
    mixed = [behind for behind in apart if 0 < behind < len(time_s)]
    near: list[FleetEvent] = []
    for behind, following in pairwise((*mixed, 0)):
        near += apart[behind]
        if following and behind - following < SHORTEST:
            continue
        if len(near) > len(apart[behind]):
            yield tuple(near)
        near = []


def _beside(asked: tuple[FleetEvent, ...], known: Array, time_s: Array) -> Array:
    """Steps of the other events; of those asked about, levels of the flights between them."""
    begun, behind = (time_s >= each.time_s for each in (asked[0], asked[-1]))
    counts = np.count_nonzero(known, axis=0)
    others, counts = known[:, counts != behind.sum()], counts[counts != behind.sum()]
    between = (counts > behind.sum()) & (counts <= begun.sum())
    return np.asarray(others - np.outer(behind, between))


def event_steps(events: Sequence[FleetEvent], time_s: Array) -> Array:
    """Flights behind each event that has some before it and some behind, shape (n, e).

    Events without a flight between them are one column: nothing tells them apart.
    """
    behind = {tuple(time_s >= event.time_s) for event in events}
    mixed = sorted(each for each in behind if any(each) and not all(each))
    return np.array(mixed, dtype=np.float64).reshape(-1, len(time_s)).T


def opened(covariance: Array, steps: Array) -> Array:
    """Covariance of a series in which steps at known flights may have any size."""
    return np.asarray(covariance + OPEN * np.diag(covariance).max() * (steps @ steps.T))


def beside_steps(values: Array, covariance: Array, steps: Array) -> tuple[Array, Array]:
    """A series without its steps at known flights, and the covariance that leaves them open.

    Example
    -------
    >>> beside_steps(np.array([2.0, 2.0, 3.0, 3.0]), np.eye(4), np.array([[0.0, 0, 1, 1]]).T)[0]
    array([2., 2., 2., 2.])
    """
    if not steps.size:
        return values, covariance
    design = np.column_stack([np.ones(len(values)), steps])
    weighed = np.linalg.solve(covariance, design)
    sizes = np.linalg.solve(design.T @ weighed, weighed.T @ values)
    return np.asarray(values - steps @ sizes[1:]), opened(covariance, steps)


def without_events(
    data: FlightEstimates, i: int, variances: Array, events: Sequence[FleetEvent]
) -> FlightEstimates:
    """Estimates of one parameter without the steps of events, by weighted least squares.

    A flight behind an event stands beside those before it as if the event had not been: else it
    looked odd, and off. Of one flight behind an event nothing is left to tell.
    """
    values = data.values.copy()
    for rows in histories_in_time(data, i):
        vehicle = data.vehicles[rows[0]]
        known = event_steps([e for e in events if e.concerns(vehicle)], data.time_s[rows])
        weights = 1.0 / np.sqrt(variances[rows])
        design = np.column_stack([np.ones(len(rows)), known]) * weights[:, None]
        found = np.linalg.lstsq(design, values[rows, i] * weights, rcond=None)[0]
        values[rows, i] -= known @ found[1:]
    return replace(data, values=values)
