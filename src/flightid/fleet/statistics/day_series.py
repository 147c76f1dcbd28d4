"""Days of histories: their means, their variances, and what may have any size in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.memory_evidence import DayGroup
from flightid.fleet.statistics.parameter_history import AskedHistory
from flightid.fleet.statistics.repeats import days_of
from flightid.frozen import dataclass

Array = NDArray[np.float64]
FEWEST_DAYS = 6
"""Of a vehicle, below which its days do not tell whether they go on. Of six vehicles of 9 days that
do, and three of 8, a third of the fleets had a red one while ten days were asked for."""
ALIKE = 1e-6
"""Share of a shape that others leave, below which it is one of them."""


@dataclass(frozen=True, eq=False)
class DaySeries:
    """Days of one vehicle.

    Attributes
    ----------
    values : ndarray, shape (d,)
    variances : ndarray, shape (d,)
        Of these, were days independent.
    level : ndarray, shape (d, e)
        What may have any size: a level, and the steps of events.
    """

    values: Array
    variances: Array
    level: Array


def day_series(asked: Sequence[AskedHistory]) -> list[DaySeries]:
    """Days of the histories that were judged and have six or more."""
    judged = (each for each in asked if each.history.chance is not None)
    return [each for each in map(_days, judged) if each is not None]


def _days(asked: AskedHistory) -> DaySeries | None:
    day = days_of(asked.history.time_s)
    if day.max() + 1 < FEWEST_DAYS:
        return None
    own, of_day = asked.own_variances, np.bincount(day, 1.0 / asked.own_variances)
    weights = (day == np.arange(day.max() + 1)[:, None]) / own / of_day[:, None]
    variances = day_variances(asked)[np.unique(day, return_index=True)[1]]
    level = _apart(weights @ np.column_stack([np.ones(len(day)), asked.known]))
    return DaySeries(weights @ asked.values, variances, level)


def _apart(design: Array) -> Array:
    """Shapes of which none is like the others: two events on one day are one."""
    own = np.abs(np.diag(np.linalg.qr(design)[1]))
    return np.asarray(design[:, own > ALIKE * own.max()])


def typical_variance(series: Sequence[DaySeries]) -> float:
    """Median variance of a day's mean, over all vehicles."""
    return float(np.median(np.concatenate([each.variances for each in series])))


def grouped(series: Sequence[DaySeries], typical: float) -> list[DayGroup]:
    """Vehicles of as many days together, in units of a typical variance."""
    held: dict[tuple[int, ...], list[tuple[Array, Array, Array]]] = {}
    for each in series:
        own = (each.values / np.sqrt(typical), each.variances / typical, each.level)
        held.setdefault(each.level.shape, []).append(own)
    return [DayGroup(*map(np.stack, zip(*each, strict=True))) for each in held.values()]


def day_variances(asked: AskedHistory) -> Array:
    """Variance of the mean of each flight's day, shape (n,)."""
    day = days_of(asked.history.time_s)
    return np.asarray(1.0 / np.bincount(day, 1.0 / asked.own_variances)[day] + asked.by_day)
