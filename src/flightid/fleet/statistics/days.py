"""What flights of one day share: days that differ, beside flights that do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.day_scatter import DayMeans, day_scatter
from flightid.fleet.statistics.events import FleetEvent, event_steps
from flightid.fleet.statistics.flight_errors import (
    FEWEST_STEPS,
    NORMAL_MEDIAN,
    added_spread,
)
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.neighbours import histories_in_time, variances_with_odd_ones
from flightid.fleet.statistics.repeats import days_of
from flightid.frozen import dataclass

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
FREEDOM_A_STEP = 0.33
"""Degrees of freedom of the square of the median step from day to day, of each step: counted on
normal draws of 2 to 12 vehicles with 4 to 12 days, 0.31 to 0.36."""


@dataclass(frozen=True, eq=False)
class SharedByDay:
    """What flights of a day share, and how well days tell it.

    Attributes
    ----------
    variances : ndarray, shape (n,)
        In the square of the unit; zero where no vehicle flew twice on a day, which leaves days in
        the errors of flights, or with fewer than 8 steps.
    freedom : float
        Of the variances of days' means; infinite where days add nothing.
    """

    variances: Array
    freedom: float = np.inf


def shared_by_day(
    data: FlightEstimates, i: int, variances: Array, events: Sequence[FleetEvent] = ()
) -> SharedByDay:
    """Variances that all flights of a vehicle's day share, for days differ.

    By steps from one day to the next, whose median is hardly moved by odd flights; then, these
    counting for less, by what a level and the largest step leave of all days (`day_scatter`), where
    that tells more. As of flights (`error_scale`) the larger of a factor f² of a day's own variance
    v = 1 / Σ 1/s² and of a variance q beside it counts: max(q, (f² − 1) v).

    Parameters
    ----------
    data : FlightEstimates
        What covariates explain, what all vehicles share and the steps of events taken out.
    i : int
        Place of the parameter.
    variances : ndarray, shape (n,)
        Of the flights, as those of one day scatter.
    events : sequence of FleetEvent
        Whose steps were taken out.

    Returns
    -------
    SharedByDay

    Assumes
    -------
    What days differ by is alike on all vehicles, and independent from day to day.
    """
    histories = list(histories_in_time(data, i))
    if not any(np.any(np.diff(days_of(data.time_s[rows])) == 0) for rows in histories):
        return SharedByDay(np.zeros(len(variances)))
    first = _by_medians(data, i, variances, histories)
    odd = variances_with_odd_ones(data, i, variances + first.variances)[0]
    odd = np.maximum(odd - first.variances, variances)
    found = day_scatter(_days_alike(data, i, odd, histories, events))
    if found.freedom <= _freedom(data, histories):
        return first
    if found.added == 0.0:
        return SharedByDay(np.zeros(len(variances)))
    of_day = np.zeros(len(variances))
    for rows in histories:
        _, _, of_day[rows] = _means(data, i, variances, rows)
    shared = np.maximum((found.factor - 1.0) * of_day, found.added)
    return SharedByDay(shared, found.freedom)


def _by_medians(
    data: FlightEstimates, i: int, variances: Array, histories: Sequence[Rows]
) -> SharedByDay:
    """By the median size of steps from one day's mean to the next day's, 0.6745 of normal ones.

    f = median |Δ| / √(v₁ + v₂) / 0.6745,   q: median |Δ| / √(v₁ + v₂ + 2 q) = 0.6745
    """
    steps, around, of_day = [np.zeros(0)], [np.zeros(0)], np.zeros(len(variances))
    for rows in histories:
        means, own, of_day[rows] = _means(data, i, variances, rows)
        steps.append(np.abs(np.diff(means)))
        around.append(own[1:] + own[:-1])
    told, stated = np.concatenate(steps), np.concatenate(around)
    if len(told) < FEWEST_STEPS:
        return SharedByDay(np.zeros(len(variances)))
    factor = max(1.0, float(np.median(told / np.sqrt(stated))) / NORMAL_MEDIAN)
    added = added_spread(told, stated)
    if factor == 1.0 and added == 0.0:
        return SharedByDay(np.zeros(len(variances)))
    shared = np.maximum((factor**2 - 1.0) * of_day, added**2)
    return SharedByDay(shared, _freedom(data, histories))


def _freedom(data: FlightEstimates, histories: Sequence[Rows]) -> float:
    """Of the median step from day to day; 0 where they are too few."""
    steps = sum(int(days_of(data.time_s[rows]).max()) for rows in histories)
    return FREEDOM_A_STEP * steps if steps >= FEWEST_STEPS else 0.0


def _means(
    data: FlightEstimates, i: int, variances: Array, rows: Rows
) -> tuple[Array, Array, Array]:
    """Means of a vehicle's days, their variances, and these by flight."""
    day = days_of(data.time_s[rows])
    weights = np.bincount(day, 1.0 / variances[rows])
    means = np.bincount(day, data.values[rows, i] / variances[rows]) / weights
    return means, 1.0 / weights, 1.0 / weights[day]


def _days_alike(
    data: FlightEstimates,
    i: int,
    variances: Array,
    histories: Sequence[Rows],
    events: Sequence[FleetEvent],
) -> list[DayMeans]:
    """Days' means of all vehicles, those of as many days and events together."""
    held: dict[tuple[int, ...], list[tuple[Array, Array, Array]]] = {}
    for rows in histories:
        means, own, _ = _means(data, i, variances, rows)
        concerned = [each for each in events if each.concerns(data.vehicles[rows[0]])]
        begun = data.time_s[rows][np.unique(days_of(data.time_s[rows]), return_index=True)[1]]
        known = np.column_stack([np.ones(len(means)), event_steps(concerned, begun)])
        held.setdefault(known.shape, []).append((means, own, known))
    return [DayMeans(*map(np.stack, zip(*each, strict=True))) for each in held.values()]


def covariance_by_day(variances: Array, time_s: Array, shared: Array) -> Array:
    """Covariance of a vehicle's flights, those of one day sharing a part of their variances.

    Example
    -------
    >>> times, shared = np.array([0.0, 3600.0, 1e6]), np.array([1.0, 1.0, 2.0])
    >>> covariance_by_day(np.array([3.0, 3.0, 5.0]), times, shared).tolist()
    [[3.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 5.0]]
    """
    day = days_of(time_s)
    together = (day[:, None] == day).astype(np.float64)
    np.fill_diagonal(together, 0.0)
    return np.asarray(np.diag(variances) + together * shared)
