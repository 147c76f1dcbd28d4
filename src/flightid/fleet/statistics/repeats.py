"""Repeats within a day: whether flights of one vehicle scatter as their errors say."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri

from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.frozen import dataclass
from flightid.uncertainty.quantiles import LEVEL, tails

DAY_S = 12.0 * 3600.0
"""From the first flight of a day to its last: a day of UTC ends within those of the Pacific."""


@dataclass(frozen=True)
class RepeatScatter:
    """Scatter of one parameter between flights of a vehicle on one day, beside its errors.

    Attributes
    ----------
    name : str
    chi2 : float
        Squares about each day's mean, in stated variances.
    freedom : int
        Flights beyond the first of each vehicle and day; 0 where none flew twice on a day.

    Example
    -------
    >>> found = RepeatScatter("Lp", 80.0, 20)
    >>> round(found.understated, 2), found.errors_hold
    (2.0, False)
    """

    name: str
    chi2: float
    freedom: int

    @property
    def chance(self) -> float | None:
        """Chance of a scatter as large were the errors as stated; None without repeats."""
        return float(chdtrc(self.freedom, self.chi2)) if self.freedom else None

    @property
    def errors_hold(self) -> bool:
        """Whether nothing speaks against the errors, at 1 %."""
        return self.chance is None or self.chance > 0.01

    @property
    def understated(self) -> float | None:
        """Factor by which standard errors fall short of the scatter; None without repeats."""
        return float(np.sqrt(self.chi2 / self.freedom)) if self.freedom else None

    @property
    def variance_factor(self) -> float:
        """What stated variances are multiplied by before anything is called a change; 1 at least.

        Birge, *Phys. Rev.* 40 (1932), 207–227.
        """
        return max(1.0, self.chi2 / self.freedom) if self.freedom else 1.0

    def understated_ends(self, level: float = LEVEL) -> tuple[float, float] | None:
        """Interval of `understated`; None without repeats."""
        if not self.freedom:
            return None
        low, high = tails(level)
        ends = np.sqrt(self.chi2 / chdtri(self.freedom, np.array([low, high])))
        return float(ends[0]), float(ends[1])


def days_of(time_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Number of the day of each time, s: flights up to 12 h from the first of their day.

    Of one vehicle; of a whole type where its vehicles fly over the same hours.

    Example
    -------
    >>> days_of(3600.0 * np.array([18.0, 25.5, 42.0, 49.5])).tolist()
    [0, 0, 1, 1]
    """
    order = np.argsort(time_s, kind="stable")
    sorted_s, day = time_s[order], np.zeros(len(time_s), dtype=np.int64)
    # A gap longer than a day's flights lie apart parts two days for sure.
    gaps = (np.flatnonzero(np.diff(sorted_s) > DAY_S) + 1).tolist()
    number = 0
    for start, end in pairwise((0, *gaps, len(sorted_s))):
        begin = start
        while begin < end:
            last = end
            if sorted_s[end - 1] - sorted_s[begin] > DAY_S:
                last = int(np.searchsorted(sorted_s, sorted_s[begin] + DAY_S, side="right"))
            day[order[begin:last]] = number
            begin, number = last, number + 1
    return day


def repeat_scatter(data: FlightEstimates) -> tuple[RepeatScatter, ...]:
    """Scatter of each parameter between flights of one vehicle on one day.

    Parameters
    ----------
    data : FlightEstimates
        Times in s; days as `days_of` has them.

    Returns
    -------
    tuple of RepeatScatter, length p
    """
    day = np.zeros(len(data.vehicles), dtype=np.int64)
    order = np.lexsort((data.time_s, data.member_of))
    for own in np.split(order, np.flatnonzero(np.diff(data.member_of[order])) + 1):
        day[own] = days_of(data.time_s[own])
    _, group = np.unique(np.column_stack([data.member_of, day]), axis=0, return_inverse=True)
    group, count = group.ravel(), int(group.max(initial=-1)) + 1
    found = []
    for i, name in enumerate(data.names):
        there = data.known[:, i]
        where, values = group[there], data.values[there, i]
        weights = 1.0 / data.covariances[there, i, i]
        total = np.bincount(where, weights, minlength=count)
        sums = np.bincount(where, weights * values, minlength=count)
        mean = sums / np.where(total > 0.0, total, 1.0)
        chi2 = float(np.sum(weights * (values - mean[where]) ** 2))
        freedom = int(there.sum() - np.count_nonzero(total))
        found.append(RepeatScatter(name, chi2 if freedom else 0.0, freedom))
    return tuple(found)
