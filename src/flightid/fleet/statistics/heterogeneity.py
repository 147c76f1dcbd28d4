"""One parameter over vehicles: how far they differ beyond their errors, and where the next lies."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import chdtrc, chdtri, ndtr, stdtr

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.uncertainty.quantiles import LEVEL, half_width, student_quantiles, tails

Array = NDArray[np.float64]
FEWEST = 3
"""Vehicles without which nothing is said of the next one."""
FEWEST_SHAPED = 4
"""Vehicles without which nothing is said of the shape of their distribution."""
SPREADS, MEANS = 200, 60
"""Quantiles of the spread's confidence distribution, and of Student's about each mean."""
HALVINGS = 60
TINY = 1e-300
"""Chance below which none is told from zero."""
REACH = 9.0
"""Standard errors beyond which nothing of a normal distribution is told from none."""
LEFT_OUT = 0.5
"""What is left out of the confidence in no spread where the next vehicle is asked for, share of it.

What stays is shared out anew: of a confidence c in none c/(2 − c) is kept.
"""


@dataclass(frozen=True, eq=False)
class VehicleEstimates:
    """A parameter of several vehicles, one number with one variance each.

    Attributes
    ----------
    values : ndarray, shape (k,)
    variances : ndarray, shape (k,)
        Of the errors of `values`, the spread between vehicles not counted.

    Raises
    ------
    DataError
        Fewer than two vehicles.

    References
    ----------
    Viechtbauer, *Statistics in Medicine* 26 (2007), 37–52 (interval of the spread by its profile);
    Higgins & Thompson, *Statistics in Medicine* 21 (2002), 1539–1558 (I²); IntHout, Ioannidis &
    Borm, *BMC Med. Res. Methodol.* 14:25 (2014) (Hartung–Knapp); Shoemaker, *Am. Stat.* 57 (2003),
    105–114 (freedom of a variance by the kurtosis); Nagashima, Noma & Furukawa,
    *Stat. Methods Med. Res.* 28 (2019), 1689–1702 (interval of the next); Röver, Knapp & Friede,
    *BMC Med. Res. Methodol.* 15:99 (2015) (means of few that agree by chance).

    Example
    -------
    >>> found = VehicleEstimates(np.array([1.0, 2.0, 3.0, 4.0]), np.full(4, 0.01))
    >>> round(found.inconsistency(5.0 / 3.0 - 0.01), 3), round(found.chance_alike, 6)
    (0.994, 0.0)
    """

    values: Array
    variances: Array

    def __post_init__(self) -> None:
        if len(self.values) < 2 or self.values.shape != self.variances.shape:
            raise DataError(
                "a spread needs several vehicles", found=self.values.shape, needed="2 or more"
            )

    @property
    def freedom(self) -> int:
        """Vehicles beyond the mean."""
        return len(self.values) - 1

    def weighed(self, spread_variance: Array) -> tuple[Array, Array, Array]:
        """Mean, sum of weights and weighed squares at variances between vehicles, shapes (m,)."""
        weights = 1.0 / (self.variances + np.asarray(spread_variance)[:, None])
        total = weights.sum(axis=1)
        mean = weights @ self.values / total
        squares = np.sum(weights * (self.values - mean[:, None]) ** 2, axis=1)
        return mean, total, squares

    @cached_property
    def chance_alike(self) -> float:
        """Chance of differences as large were all vehicles the same (Cochran's Q)."""
        return float(chdtrc(self.freedom, self.weighed(np.zeros(1))[2][0]))

    def hartung_knapp(self, spread_variance: float) -> float:
        """Factor of the mean's variance by the scatter about it, the spread taken for known."""
        return float(self.weighed(np.array([spread_variance]))[2][0] / self.freedom)

    def inconsistency(self, spread_variance: float) -> float:
        """I²: share of the variance of estimates that is between vehicles."""
        weights = 1.0 / self.variances
        total = weights.sum()
        typical = self.freedom * total / (total**2 - np.sum(weights**2))
        return float(spread_variance / (spread_variance + typical))

    @cached_property
    def _spread_freedom(self) -> float:
        """Degrees of freedom of the scatter, fewer where vehicles lie further out than normal.

        Of k draws a variance has the relative variance 2/(k − 1) + excess/k; the excess is their
        own sample kurtosis, about the spread in the middle of its confidence distribution.
        """
        k = len(self.values)
        if k < FEWEST_SHAPED:
            return float(self.freedom)
        middle = self.spread_quantiles(np.array([0.5]))
        weights = 1.0 / (self.variances + middle)
        apart = np.sqrt(weights) * (self.values - weights @ self.values / weights.sum())
        second = float(np.mean(apart**2))
        if second == 0.0:  # all alike: nothing of their shape shows
            return float(self.freedom)
        fourth = float(np.mean(apart**4)) / second**2
        excess = (k - 1) / ((k - 2) * (k - 3)) * ((k + 1) * (fourth - 3.0) + 6.0)
        return self.freedom / (1.0 + max(excess, 0.0) * self.freedom / (2.0 * k))

    def spread_quantiles(self, shares: Array, freedom: float | None = None) -> Array:
        """Quantiles of the confidence distribution of the variance between vehicles.

        At the true variance the weighed squares are χ² with k − 1 degrees of freedom, exactly so
        for normal errors, and they fall as it grows: P(variance ≤ v) = P(χ² ≥ Q(v)). With fewer
        degrees of freedom they scatter more about the same mean.
        """
        freedom = self.freedom if freedom is None else freedom
        target = chdtri(freedom, np.asarray(shares)) * self.freedom / freedom
        scale = float(np.var(self.values) + self.variances.mean())
        low = np.full(len(target), np.log(1e-12 * scale))
        high = np.full(len(target), np.log(1e12 * scale))
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            below = self.weighed(np.exp(middle))[2] > target
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return np.where(self.weighed(np.zeros(1))[2] <= target, 0.0, np.exp(high))

    def spread_ends(self, level: float = LEVEL) -> tuple[float, float]:
        """Interval of the standard deviation between vehicles, in the values' unit.

        Longer where vehicles lie further out than normal ones do, as their kurtosis tells; of few
        vehicles that shows in part alone.
        """
        low, high = np.sqrt(self.spread_quantiles(np.array(tails(level)), self._spread_freedom))
        return float(low), float(high)

    @cached_property
    def _means(self) -> tuple[Array, Array, Array]:
        """Means, their standard errors and what each counts, by variances between vehicles.

        Without any confidence in none: of few vehicles whose errors differ, estimates that agree by
        chance would else hang the mean on one of them. Of three with errors from 1 to 10 and a
        spread of 10 the mean was held in 91 % by the likeliest spread alone, in 94 % by all.
        """
        shares, weights = _shares(SPREADS)
        none = self.chance_alike
        mean, total, squares = self.weighed(self.spread_quantiles(none + (1.0 - none) * shares))
        return mean, np.sqrt(squares / self.freedom / total), weights

    def mean_ends(self, level: float = LEVEL) -> tuple[float, float]:
        """Interval of the mean, by Hartung and Knapp, over all spreads that the vehicles allow.

        Where errors are alike it is theirs at any spread; where they differ the spread says how
        much each vehicle counts, and is as uncertain as its confidence distribution. Never shorter
        than errors alone make it: where estimates agree by chance it would be, and of two vehicles
        such intervals held the mean in 60 %, of ten in 88 %.
        """
        low, high = self._allowed_ends(level)
        least = half_width(level) / np.sqrt(np.sum(1.0 / self.variances))
        more = max(float(least) - 0.5 * (high - low), 0.0)
        return low - more, high + more

    def _allowed_ends(self, level: float) -> tuple[float, float]:
        """Quantiles of Student's t about the mean at each spread, by what it counts."""
        mean, error, weights = self._means
        if error.max() == 0.0:
            return float(mean.mean()), float(mean.mean())
        reach = abs(float(student_quantiles(np.array(tails(level)[:1]), self.freedom)[0]))
        found = []
        for share in tails(level):
            low, high = float((mean - reach * error).min()), float((mean + reach * error).max())
            for _ in range(HALVINGS // 2):
                middle = 0.5 * (low + high)
                turn = (middle - mean) / np.maximum(error, 1e-12 * error.max())
                below = float(weights @ stdtr(self.freedom, turn))
                low, high = (middle, high) if below < share else (low, middle)
            found.append(0.5 * (low + high))
        return found[0], found[1]

    @cached_property
    def _mixture(self) -> tuple[Array, Array, Array]:
        """Centres (m, j), standard deviations (m, 1) and weights (m, j) of the next one.

        All variances that would be negative count as none in the confidence distribution. Taken as
        it is, of 20 vehicles whose spread is half the error of an estimate the next one lay in
        its interval in 93 %; without any confidence in none it lies there in 99 %.
        """
        shares, weights = _shares(SPREADS)
        none = LEFT_OUT * self.chance_alike
        variance = self.spread_quantiles(none + (1.0 - none) * shares)
        mean, total, squares = self.weighed(variance)
        error = np.sqrt(squares / self.freedom / total)
        places, more = _shares(MEANS)
        turn = student_quantiles(places, self.freedom)
        centre = mean[:, None] + error[:, None] * turn
        return centre, np.sqrt(variance)[:, None], np.outer(weights, more)

    def next_ends(self, level: float = LEVEL) -> tuple[float, float] | None:
        """Interval that holds the next vehicle; None with fewer than three, or of equal values.

        The next vehicle is normal about the mean; mean and spread are as uncertain as their
        confidence distributions say. No random numbers. Never inside the interval of the mean,
        which is no shorter than errors alone make it.
        """
        if len(self.values) < FEWEST:
            return None
        centre, deviation, weights = self._mixture
        reach = float(np.max(np.abs(centre - self.values.mean())) + 9.0 * np.max(deviation))
        if reach == 0.0:
            return None
        found = []
        for share in tails(level):
            low, high = self.values.mean() - reach, self.values.mean() + reach
            for _ in range(HALVINGS // 2):
                middle = 0.5 * (low + high)
                inside = ndtr((middle - centre) / np.maximum(deviation, 1e-12 * reach))
                below = float(np.sum(weights * inside))
                low, high = (middle, high) if below < share else (low, middle)
            found.append(float(0.5 * (low + high)))
        # The next one lies about the mean, which is known no better than its interval says.
        low, high = self.mean_ends(level)
        return min(found[0], low), max(found[1], high)

    def next_chance(self, value: float, variance: float) -> float:
        """Chance that the next vehicle, estimated with a variance, lies as far to either side."""
        centre, deviation, weights = self._mixture
        reach = np.sqrt(deviation**2 + variance)
        below = float(np.sum(weights * ndtr((value - centre) / reach)))
        above = float(np.sum(weights * ndtr((centre - value) / reach)))
        return min(1.0, 2.0 * min(below, above))

    def next_reach(self, variance: float, chance: float, power: float) -> float:
        """Distance of a next vehicle from the mean at which it is called rare with a power.

        Rare is one whose `next_chance` is below `chance`; its own estimate has a variance, and
        where the mean lies is as uncertain as its confidence distribution says.
        """
        centre, deviation, weights = self._mixture
        middle = float(np.sum(weights * centre))

        def beyond(distance: float) -> float:
            found = [self.next_chance(middle + s * distance, variance) for s in (-1.0, 1.0)]
            return float(np.log(max(0.5 * sum(found), TINY))) - float(np.log(chance))

        most = float(np.sqrt(np.sum(weights * deviation**2) + variance))
        while beyond(most) > 0.0:
            most *= 2.0
        limit, own = float(brentq(beyond, 0.0, most, rtol=1e-3)), np.sqrt(variance)

        def missing(distance: float) -> float:
            return float(np.sum(weights * ndtr((centre - middle + distance - limit) / own))) - power

        far = limit + float(np.max(np.abs(centre - middle))) + REACH * float(own)
        return float(brentq(missing, 0.0, far, rtol=1e-3))


def _shares(count: int) -> tuple[Array, Array]:
    """Probabilities that lie closer towards 0 and 1, and what each stands for."""
    even = (np.arange(count) + 0.5) / count
    weights = even * (1.0 - even)
    return even**2 * (3.0 - 2.0 * even), weights / weights.sum()
