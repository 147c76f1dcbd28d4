"""A level that wanders between flights, followed through errors that are known: a scalar filter.

The level moves by a random walk, m(t + Δ) = m(t) + N(0, q Δ); an estimate is y = m + N(0, s²). The
first level is unknown, so the likelihood is that of what follows the first flight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, ShapeError
from flightid.frozen import dataclass
from flightid.uncertainty.quantiles import LEVEL, half_width

Array = NDArray[np.float64]
RATES = 41
"""Rates of a search, a quarter of a decade apart on average."""
DECADES = (-4.0, 3.0)
"""Of the walk over the whole span beside one flight's error, from the least to the most."""


@dataclass(frozen=True, eq=False)
class LocalLevel:
    """A series with the level behind it.

    Attributes
    ----------
    rate : float
        q: growth of the level's variance, values² / s; 0 for one that stays.
    log_likelihood : float
        Of the flights behind the first.
    level, variance : ndarray, shape (n,)
        Of the level at each flight, by all of them, `rate` taken for true.

    Example
    -------
    >>> found = follow_level(np.array([1.0, 1.1, 0.9]), np.full(3, 0.01), np.arange(3.0), 0.0)
    >>> found.level.round(6).tolist(), found.variance.round(6).tolist()
    ([1.0, 1.0, 1.0], [0.003333, 0.003333, 0.003333])
    """

    rate: float
    log_likelihood: float
    level: Array
    variance: Array

    def ends(self, level: float = LEVEL) -> Array:
        """Lower and upper end of the level at each flight, shape (n, 2)."""
        half = half_width(level) * np.sqrt(self.variance)
        return np.column_stack([self.level - half, self.level + half])


def follow_level(
    values: Array, variances: Array, time_s: Array, rate: float | None = None
) -> LocalLevel:
    """Follow the level of a series, forwards and backwards.

    Parameters
    ----------
    values : ndarray, shape (n,)
    variances : ndarray, shape (n,)
        Of the errors of `values`, independent.
    time_s : ndarray, shape (n,)
        Ascending.
    rate : float, optional
        q, values² / s; default: of the highest likelihood.

    Returns
    -------
    LocalLevel

    Raises
    ------
    ShapeError
        Shapes that do not agree.
    DataError
        No flight, times that fall, variances that are not positive, a negative rate.

    Reference
    ---------
    Durbin & Koopman, *Time Series Analysis by State Space Methods*, 2nd ed. (2012), sections 2.2
    (filter), 2.4 (smoother), 2.9 (diffuse start).
    """
    _require(values, variances, time_s, rate)
    gaps = np.diff(time_s)
    if rate is None:
        rates = _rates(variances, time_s)
        likelihoods = _filtered(values, variances, gaps, rates)[2]
        rate = float(rates[int(np.argmax(likelihoods))])
    at = np.array([rate])
    level, variance, likelihood = _filtered(values, variances, gaps, at)
    smooth, spread = level[:, 0].copy(), variance[:, 0].copy()
    for j in range(len(values) - 2, -1, -1):
        ahead = variance[j, 0] + rate * gaps[j]
        gain = variance[j, 0] / ahead
        smooth[j] = level[j, 0] + gain * (smooth[j + 1] - level[j, 0])
        spread[j] = variance[j, 0] + gain**2 * (spread[j + 1] - ahead)
    return LocalLevel(rate, float(likelihood[0]), smooth, spread)


def _require(values: Array, variances: Array, time_s: Array, rate: float | None) -> None:
    if not values.shape == variances.shape == time_s.shape or values.ndim != 1:
        raise ShapeError(
            "values, variances and times of a series",
            found=(values.shape, variances.shape, time_s.shape),
            needed="one each a flight",
        )
    if not len(values) or np.any(np.diff(time_s) < 0.0) or not np.all(variances > 0.0):
        raise DataError(
            "a series cannot be followed",
            needed="a flight or more, in order of time, with positive variances",
        )
    if rate is not None and not rate >= 0.0:
        raise DataError("a variance cannot shrink with time", found=rate, needed="a rate from 0 on")


def _rates(variances: Array, time_s: Array) -> Array:
    """None, and rates that span from what no series shows to what hides nothing."""
    span = float(time_s[-1] - time_s[0])
    if span <= 0.0:
        return np.zeros(1)
    return np.append(0.0, float(np.median(variances)) / span * np.logspace(*DECADES, RATES))


def _filtered(
    values: Array, variances: Array, gaps: Array, rates: Array
) -> tuple[Array, Array, Array]:
    """Level and variance after each flight, shapes (n, m), and log likelihood, shape (m,)."""
    n, m = len(values), len(rates)
    level, variance = np.empty((n, m)), np.empty((n, m))
    level[0], variance[0] = values[0], variances[0]
    likelihood = np.zeros(m)
    for j in range(1, n):
        ahead = variance[j - 1] + rates * gaps[j - 1]
        innovation, size = values[j] - level[j - 1], ahead + variances[j]
        gain = ahead / size
        level[j] = level[j - 1] + gain * innovation
        variance[j] = (1.0 - gain) * ahead
        likelihood -= 0.5 * (np.log(2.0 * np.pi * size) + innovation**2 / size)
    return level, variance, likelihood
