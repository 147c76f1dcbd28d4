"""Wear of all on the same dates: how far all vehicles rise or fall, from when to when."""

from __future__ import annotations

import datetime

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import LEVEL, shown

Array = NDArray[np.float64]
Places = NDArray[np.intp]
LONG = 0.5
"""Share of the fleet's time that a vehicle's flights span, from which its own slope counts."""
FEWEST = 3
"""Days with a flight, from which a vehicle has a slope of its own."""


@dataclass(frozen=True, eq=False)
class SharedTrend:
    """The last level of all vehicles beside the first, by lines through their flights.

    Attributes
    ----------
    change : Estimate
        In percent of the first level, or in the unit where a level may be zero.
    first_s, last_s : float
        Instants of the first and the last flight.
    """

    change: Estimate
    first_s: float
    last_s: float

    @property
    def words(self) -> str:
        """Direction, size and dates: "fell by 20 % (24 to 16 % …)"."""
        size, unit = self.change.value, "" if self.change.unit == "1" else f" {self.change.unit}"
        low, high = self.change.interval(shown()) or (-np.inf, np.inf)
        first, last = (
            datetime.datetime.fromtimestamp(each, datetime.UTC).date().isoformat()
            for each in (self.first_s, self.last_s)
        )
        did = "fell" if size < 0.0 else "rose"
        ends = f"({low:+.2g} to {high:+.2g}{unit})"
        return (
            f"{did} by {abs(size):.2g}{unit} {ends} from {first} to {last}: wear of all, a season, "
            "or a change of what measures them"
        )


def shared_trend(
    residual: Array, member: Places, time_s: Array, day: Places, estimate: Estimate
) -> SharedTrend | None:
    """The rise or fall that vehicles share, where their own lines tell its direction.

    A line by least squares through the flights of each vehicle that spans half of the time; the
    error of their mean is what these differ by, or, where larger, what days of all differ by beside
    the line (their correlation from day to day makes (1 + ρ)/(1 − ρ) of its variance).

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Flights about their vehicle's median, in shares of it where `estimate` is in percent.
    member, time_s, day : ndarray, shape (n,)
    estimate : Estimate
        Gives name and unit.

    Returns
    -------
    SharedTrend or None
        None where fewer than three vehicles tell a slope, or its interval holds none.
    """
    first_s, last_s = float(time_s.min()), float(time_s.max())
    at = (time_s - first_s) / (last_s - first_s) - 0.5
    ends, beside = [], np.full(len(residual), np.nan)
    for each in np.unique(member):
        mine = member == each
        if np.ptp(at[mine]) < LONG or len(np.unique(day[mine])) < FEWEST:
            continue
        slope, level = np.polyfit(at[mine], residual[mine], 1)
        beside[mine] = residual[mine] - level - slope * at[mine]
        ends.append((level - slope / 2.0, level + slope / 2.0))
    if len(ends) < FEWEST:
        return None
    first, last = np.array(ends).T
    in_percent = estimate.unit == "%"
    if in_percent and np.any(first <= -1.0 + np.finfo(np.float64).eps):
        return None
    own = 100.0 * (last - first) / (1.0 + first) if in_percent else last - first
    scale = 100.0 / (1.0 + float(first.mean())) if in_percent else 1.0
    between, freedom = float(own.var(ddof=1)) / len(own), len(own) - 1.0
    by_days, days = _variance_of_days(beside, at, day)
    if scale**2 * by_days > between:
        between, freedom = scale**2 * by_days, days - 2.0
    change = Estimate(
        estimate.name, float(own.mean()), estimate.unit, float(np.sqrt(between)), freedom=freedom
    )
    held = change.interval(LEVEL)
    if held is None or held[0] <= 0.0 <= held[1]:
        return None
    return SharedTrend(change, first_s, last_s)


def _variance_of_days(beside: Array, at: Array, day: Places) -> tuple[float, int]:
    """Variance of a line's rise by what days of all vehicles differ by, and the number of days."""
    told = np.isfinite(beside)
    days = np.unique(day[told])
    means = np.array([beside[told & (day == d)].mean() for d in days])
    when = np.array([at[told & (day == d)].mean() for d in days])
    if len(days) <= FEWEST:
        return 0.0, len(days)
    square = float(means @ means) / (len(days) - 2)
    memory = float(means[1:] @ means[:-1]) / float(means @ means) if square > 0.0 else 0.0
    memory = min(max(memory, 0.0), 0.9)
    return (
        square / float(np.sum((when - when.mean()) ** 2)) * (1.0 + memory) / (1.0 - memory),
        len(days),
    )
