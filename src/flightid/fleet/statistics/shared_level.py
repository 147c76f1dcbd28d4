"""What all vehicles of a type share by date: air, season, a firmware for all; no vehicle's change.

Vehicles are held against it before anything is called a change of theirs, and it is a finding by
itself.
"""

from __future__ import annotations

import datetime
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.own_steps import own_steps
from flightid.fleet.statistics.repeats import days_of
from flightid.fleet.statistics.shared_chance import shared_chance
from flightid.fleet.statistics.shared_shape import SharedShape, shared_shape
from flightid.fleet.statistics.shared_trend import SharedTrend, shared_trend
from flightid.frozen import dataclass
from flightid.record.outlying import NORMAL_MAD
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import shown

Array = NDArray[np.float64]
Places = NDArray[np.intp]
WEEK_S = 7.0 * 86400.0
FEWEST_VEHICLES = 5
"""In a week, below which nothing is called shared."""
AGREEING = 0.85
"""Share of vehicles that move with the others, from which all do: of a change of fewer than 70 % of
vehicles, with the others by chance either way, as many seem to."""
CHANCE = 0.05
"""Of as many vehicles that agree were each as likely not to."""
FLIPPED = 1.0 / 16.0
"""Chance of a common step as large (`shared_chance`): the least that five vehicles can tell."""
SMALL = 30
"""Vehicles, up to which one counts in the median it is held against."""


@dataclass(frozen=True, eq=False)
class SharedLevel:
    """How one parameter of all vehicles of a type moved together.

    Attributes
    ----------
    name : str
    moved : ndarray, shape (n,)
        By flight, in the unit of the parameter; taken out of every vehicle.
    variances : ndarray, shape (n,)
        Of `moved`.
    is_step : bool
        Whether it may be one step (`shared_shape`).
    since_s : float
        First instant behind the step that explains most.
    change : Estimate
        That step: percent of each vehicle's median, or in the unit where a median may be zero.
    least, most : float
        Of the whole movement, in the unit of `change`.
    vehicles, agreeing : int
        Vehicles that tell it, and those of them that move with the others: of a step those whose
        own is told apart from none, and not apart from it.
    trend : SharedTrend or None
        Where all may rise or fall gradually; beside a step where days do not tell which it is.
    telling : tuple of str
        Of a step: vehicles whose own is told apart from none, and not apart from it.
    """

    name: str
    moved: Array
    variances: Array
    is_step: bool
    since_s: float
    change: Estimate
    least: float
    most: float
    vehicles: int
    agreeing: int
    trend: SharedTrend | None = None
    telling: tuple[str, ...] = ()

    def words(self, labels: Mapping[str, str], apart: Collection[str] = ()) -> str:
        """What all did together, or most beside those that are apart; dates on the clock of Unix.

        A vehicle without the change may move with the others by chance, and is apart all the same.
        """
        name = labels.get(self.name, self.name)
        count = min(self.agreeing, self.vehicles - len(apart))
        whose = f"{count} of {self.vehicles} vehicles"
        if apart:
            some = "one" if len(apart) == 1 else "some"
            whose += f"; {', '.join(sorted(apart))} may be {some} that did not"
        elif count < self.vehicles and self.is_step:
            whose += " tell it by themselves"
        who = "all" if count == self.vehicles else "most"
        who = who if not self.is_step or 2 * count > self.vehicles else "the"
        return f"{name}: {who} vehicles {self.course} ({whose})"

    @property
    def course(self) -> str:
        """What they did: at once, gradually, either where their days do not tell, or otherwise."""
        unit = "" if self.change.unit == "1" else f" {self.change.unit}"
        since = datetime.datetime.fromtimestamp(self.since_s, datetime.UTC).date().isoformat()
        low, high = self.change.interval(shown()) or (-np.inf, np.inf)
        by = f"{self.change.value:+.2g}{unit} ({low:+.2g} to {high:+.2g}{unit})"
        at_once = f"changed together by {by} from {since}"
        if self.trend is not None and self.is_step:
            return f"{at_once}, or {self.trend.words}; their days do not tell which"
        if self.trend is not None:
            return self.trend.words
        if self.is_step:
            return at_once
        ends = f"{self.least:+.2g} to {self.most:+.2g}{unit} of its usual value"
        return f"moved together by date, {ends}"


def shared_level(data: FlightEstimates, i: int) -> SharedLevel | None:
    """Find what vehicles of a type share by date, where nearly all move alike.

    r = y / m − 1 with the median m of each vehicle (y − m where a median may be zero); the shared
    level of a week is the median of r over its flights, weeks parted at the largest common step.
    It counts where its largest step is rare were nothing shared (`shared_chance`), ≥ 85 % of
    vehicles have Σ r c > 0 with the level c of the others, and so many by chance in less than 5 %,
    and not where more than a few stayed (`OwnSteps.some_stayed`): of three
    of six that change by 10 % the level would be half of it, and all six move with it.

    Parameters
    ----------
    data : FlightEstimates
        What covariates explain taken out.
    i : int
        Place of the parameter.

    Returns
    -------
    SharedLevel or None
        None where no two weeks have five vehicles, or vehicles do not agree.

    Assumes
    -------
    Vehicles that fly over the same time: of those that fly one after the other their medians take
    most of it. A change of most vehicles at one date is shared by this definition; those that did
    not change then look changed, the other way.
    """
    rows = np.flatnonzero(data.known[:, i])
    if len(set(data.member_of[rows])) < FEWEST_VEHICLES:
        return None
    scale, residual, in_percent = _residuals(data, i, rows)
    member, time_s = data.member_of[rows], data.time_s[rows]
    day = days_of(time_s)
    places = _told_on_both_sides(day, member)
    since = _common_step(residual, time_s, day, places)
    if since is None or shared_chance(residual, member, day, np.array(places)) > FLIPPED:
        return None
    begun = _first_of(time_s, day)[day]  # A day is of one week, whatever clock it is told by.
    bins = _weeks(begun, since)
    level, variance, counts = _levels(residual, member, bins)
    if np.count_nonzero(counts) < 2:
        return None
    agreeing, vehicles = _agreeing(residual, member, bins, level)
    if agreeing < AGREEING * vehicles or bdtrc(agreeing - 1, vehicles, 0.5) > CHANCE:
        return None
    moved, variances = np.zeros(len(data.vehicles)), np.zeros(len(data.vehicles))
    moved[rows], variances[rows] = scale * level[bins], scale**2 * variance[bins]
    there = counts > 0
    after = np.array([time_s[bins == b].min() >= since for b in np.flatnonzero(there)])
    told = _step(level[there], variance[there], counts[there], after)
    step = Estimate(data.names[i], told[0], "1", told[1])
    steps = own_steps(residual - level[bins], member, day, time_s >= since, step)
    if steps.some_stayed:
        return None
    size, unit = (100.0, "%") if in_percent else (1.0, data.units[i])
    change = Estimate(data.names[i], size * told[0], unit, size * told[1])
    shape = _shape(residual, member, (bins, day), time_s, since)
    trend = shared_trend(residual, member, time_s, day, change) if shape.may_line else None
    return SharedLevel(
        data.names[i],
        *(moved, variances, shape.may_step, since, change),
        *(size * float(level[there].min()), size * float(level[there].max())),
        *(vehicles, len(steps.telling) if shape.may_step else agreeing),
        trend,
        tuple(data.members[place] for place in steps.telling),
    )


def _shape(
    residual: Array, member: Places, bins: tuple[Places, Places], time_s: Array, since: float
) -> SharedShape:
    """By days where more of them than of weeks have five vehicles, for they tell more."""
    held = [(each, *_levels(residual, member, each)) for each in bins]
    each, level, variance, counts = max(held, key=lambda one: np.count_nonzero(one[3]))
    there = np.flatnonzero(counts)
    at = np.array([time_s[each == b].mean() for b in there])
    after = np.array([time_s[each == b].min() >= since for b in there])
    return shared_shape(level[there], variance[there], counts[there], at, after)


def without_shared(data: FlightEstimates, i: int, shared: SharedLevel | None) -> FlightEstimates:
    """Estimates without what all vehicles share, which is as uncertain as it is."""
    if shared is None:
        return data
    values, covariances = data.values.copy(), data.covariances.copy()
    values[:, i] -= shared.moved
    covariances[:, i, i] += shared.variances
    return replace(data, values=values, covariances=covariances)


def _residuals(data: FlightEstimates, i: int, rows: Places) -> tuple[Array, Array, bool]:
    """Scale of each flight's vehicle, and flights about their vehicle's median in that scale."""
    values, member = data.values[rows, i], data.member_of[rows]
    median = np.zeros(len(data.members))
    for each in np.unique(member):
        median[each] = np.median(values[member == each])
    own = median[member]
    in_percent = bool(np.all(np.abs(own) > 3.0 * np.sqrt(np.median(data.covariances[rows, i, i]))))
    scale = np.abs(own) if in_percent else np.ones(len(rows))
    return scale, (values - own) / scale, in_percent


def _first_of(time_s: Array, day: Places) -> Array:
    """First instant of each day."""
    first = np.full(int(day.max()) + 1, np.inf)
    np.minimum.at(first, day, time_s)
    return first


def _weeks(begun: Array, since: float) -> Places:
    """Number of the week of each flight, by the beginning of its day; weeks end at an instant too.

    A week is of the days up to seven from its first: by the calendar those of one round of flights
    may lie in two, and too few vehicles in one of them.
    """
    starts, place = np.unique(begun, return_inverse=True)
    week, number, first = np.zeros(len(starts), dtype=np.intp), -1, -np.inf
    for k, start in enumerate(starts):
        if start - first >= WEEK_S or first < since <= start:
            number, first = number + 1, start
        week[k] = number
    return np.asarray(week[place], dtype=np.intp)


def _common_step(
    residual: Array, time_s: Array, day: Places, places: Sequence[int]
) -> float | None:
    """First instant behind the largest step of the days' medians; None where there is no place."""
    begun = _first_of(time_s, day)
    medians = np.array([np.median(residual[day == d]) for d in range(len(begun))])
    counts = np.bincount(day).astype(np.float64)
    best, since = -1.0, None
    total, whole = float(counts @ medians), float(counts.sum())
    before, weight = np.cumsum(counts * medians), np.cumsum(counts)
    for place in places:
        n = float(weight[place - 1])
        apart = float(before[place - 1]) / n - (total - float(before[place - 1])) / (whole - n)
        if n * (whole - n) * apart**2 > best:
            best, since = n * (whole - n) * apart**2, float(begun[place])
    return since


def _told_on_both_sides(day: Places, member: Places) -> list[int]:
    """Days with five vehicles before them, and five on them or behind."""
    _, vehicle = np.unique(member, return_inverse=True)
    first, last = np.full(vehicle.max() + 1, day.max()), np.zeros(vehicle.max() + 1, dtype=np.intp)
    np.minimum.at(first, vehicle, day)
    np.maximum.at(last, vehicle, day)
    before, behind = np.sort(first), np.sort(last)
    places = np.arange(1, int(day.max()) + 1)
    many = np.searchsorted(before, places) >= FEWEST_VEHICLES
    many &= len(behind) - np.searchsorted(behind, places) >= FEWEST_VEHICLES
    return [int(each) for each in places[many]]


def _levels(residual: Array, member: Places, bins: Places) -> tuple[Array, Array, Array]:
    """Median of each week, its variance and its flights; 0 where fewer than five vehicles flew."""
    count = int(bins.max()) + 1
    level, variance, flights = np.zeros(count), np.zeros(count), np.zeros(count)
    for b in range(count):
        mine = bins == b
        if len(np.unique(member[mine])) < FEWEST_VEHICLES:
            continue
        each = residual[mine]
        level[b], flights[b] = np.median(each), len(each)
        deviation = NORMAL_MAD * float(np.median(np.abs(each - level[b])))
        variance[b] = 0.5 * np.pi * deviation**2 / len(each)
    return level, variance, flights


def _agreeing(residual: Array, member: Places, bins: Places, level: Array) -> tuple[int, int]:
    """Vehicles that move with the others, and all that can tell."""
    agreeing, vehicles = 0, np.unique(member)
    for each in vehicles:
        mine = member == each
        beside = level
        if len(vehicles) <= SMALL:
            beside = np.zeros(len(level))
            for b in np.unique(bins[mine]):
                others = residual[(bins == b) & ~mine]
                if level[b] != 0.0 and len(others):
                    beside[b] = np.median(others)
        # Each vehicle about its own level: it knows of the movement, not of where it stands.
        course = beside[bins[mine]] - beside[bins[mine]].mean()
        agreeing += bool(course @ residual[mine] > 0.0)
    return agreeing, len(vehicles)


def _step(
    level: Array, variance: Array, counts: Array, after: NDArray[np.bool_]
) -> tuple[float, float]:
    """Step of weekly levels, and its standard error."""
    shares = [
        np.where(side, counts, 0.0) / max(counts[side].sum(), 1.0) for side in (~after, after)
    ]
    before, behind = (float(share @ level) for share in shares)
    stderr = float(np.sqrt(sum(float(share**2 @ variance) for share in shares)))
    return behind - before, stderr
