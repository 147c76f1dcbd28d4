"""What flights of one day share: days that differ, beside flights that do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.flight_errors import (
    FEWEST_STEPS,
    NORMAL_MEDIAN,
    added_spread,
)
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.neighbours import histories_in_time
from flightid.fleet.statistics.repeats import days_of
from flightid.frozen import dataclass

Array = NDArray[np.float64]
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


def shared_by_day(data: FlightEstimates, i: int, variances: Array) -> SharedByDay:
    """Variances that all flights of a vehicle's day share, for days differ.

    From a day's mean to the next day's the median size of steps is that of normal ones (0.6745):

        f = median |Δ| / √(v₁ + v₂) / 0.6745,   q: median |Δ| / √(v₁ + v₂ + 2 q) = 0.6745

    with v = 1 / Σ 1/s² of a day. As of flights (`error_scale`) the larger counts:
    max(q, (f² − 1) v). The median of n steps scatters as a mean of squares of n / 3 normal ones
    does, which is its freedom.

    Parameters
    ----------
    data : FlightEstimates
        What covariates explain, what all vehicles share and the steps of events taken out.
    i : int
        Place of the parameter.
    variances : ndarray, shape (n,)
        Of the flights, as those of one day scatter.

    Returns
    -------
    SharedByDay

    Assumes
    -------
    Changes from one day to the next small beside what days differ by; those are independent.
    """
    steps, around, repeated = [np.zeros(0)], [np.zeros(0)], False
    of_day = np.zeros(len(variances))
    for rows in histories_in_time(data, i):
        _, day = np.unique(days_of(data.time_s[rows]), return_inverse=True)
        repeated = repeated or bool(np.any(np.diff(day) == 0))
        weights = np.bincount(day, 1.0 / variances[rows])
        means = np.bincount(day, data.values[rows, i] / variances[rows]) / weights
        steps.append(np.abs(np.diff(means)))
        around.append(1.0 / weights[1:] + 1.0 / weights[:-1])
        of_day[rows] = 1.0 / weights[day]
    told, stated = np.concatenate(steps), np.concatenate(around)
    if not repeated or len(told) < FEWEST_STEPS:
        return SharedByDay(np.zeros(len(variances)))
    factor = max(1.0, float(np.median(told / np.sqrt(stated))) / NORMAL_MEDIAN)
    added = added_spread(told, stated)
    if factor == 1.0 and added == 0.0:
        return SharedByDay(np.zeros(len(variances)))
    shared = np.maximum((factor**2 - 1.0) * of_day, added**2)
    return SharedByDay(shared, FREEDOM_A_STEP * len(told))


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
