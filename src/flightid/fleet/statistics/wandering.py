"""Whether a level wanders at all: the locally best test against a random walk, with its chance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr

from flightid.errors import DataError, ShapeError

Array = NDArray[np.float64]
NEGLIGIBLE = 1e-9
"""Share of the largest eigenvalue below which one adds nothing."""
NEAR = 1e-4
"""Of the mean, in standard deviations: there the expansion is taken at the mean."""


def wandering_chance(values: Array, covariance: Array, time_s: Array) -> float:
    """Chance of wandering as far were the level to stay where it is.

    The score of the rate of a random walk at zero is a quadratic form of the residuals about a
    constant, hence a sum of squared normals with known weights.

    Parameters
    ----------
    values : ndarray, shape (n,)
        In order of time.
    covariance : ndarray, shape (n, n)
        Of their errors.
    time_s : ndarray, shape (n,)
        Ascending.

    Returns
    -------
    float
        From 0 to 1; 1 where all flights are of one instant. By the saddlepoint: within a few
        percent of itself, in the far tail too.

    Raises
    ------
    ShapeError
        Shapes that do not agree.
    DataError
        A covariance that is not positive definite.

    Reference
    ---------
    Nyblom & Mäkeläinen, *J. Am. Stat. Assoc.* 78 (1983), 856–864 (the test); Kuonen, *Biometrika*
    86 (1999), 929–935 (its chance).

    Example
    -------
    >>> ramp = wandering_chance(np.arange(9.0), np.eye(9), np.arange(9.0))
    >>> still = wandering_chance(np.array([1.0, -1.0] * 4), np.eye(8), np.arange(8.0))
    >>> ramp < 1e-8, still > 0.5
    (True, True)
    """
    n = len(values)
    if covariance.shape != (n, n) or time_s.shape != (n,):
        raise ShapeError(
            "covariance and times of a series",
            found=(covariance.shape, time_s.shape),
            needed=((n, n), (n,)),
        )
    try:
        root = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise DataError(
            "the errors of a series have no positive covariance", needed="a positive definite one"
        ) from error
    since = time_s - time_s[0]
    if n < 3 or since[-1] <= 0.0:
        return 1.0
    walk = np.minimum(since[:, None], since) / since[-1]
    whitened = np.linalg.solve(root, np.column_stack([values, np.ones(n), walk]))
    y, one = whitened[:, 0], whitened[:, 1]
    inner = np.linalg.solve(root, whitened[:, 2:].T)
    along = one / np.sqrt(one @ one)
    residual = y - along * (along @ y)
    inner = inner - np.outer(along, along @ inner)
    inner = inner - np.outer(inner @ along, along)
    weights = np.linalg.eigvalsh(0.5 * (inner + inner.T))
    weights = weights[weights > NEGLIGIBLE * weights[-1]]
    return squares_chance(float(residual @ inner @ residual), weights)


def squares_chance(statistic: float, weights: Array) -> float:
    """Chance that a weighed sum of squared standard normals is above a number.

    Parameters
    ----------
    statistic : float
    weights : ndarray, shape (m,)
        Positive.

    Returns
    -------
    float
        By the saddlepoint approximation of Lugannani and Rice.

    Example
    -------
    >>> round(squares_chance(18.307038053275, np.ones(10)), 3)
    0.05
    """
    scaled = weights / weights.max()
    target = statistic / float(weights.max())
    if target <= 0.0:
        return 1.0
    mean, deviation = float(scaled.sum()), float(np.sqrt(2.0 * np.sum(scaled**2)))
    if abs(target - mean) < NEAR * deviation:
        above, below = mean + NEAR * deviation, mean - NEAR * deviation
        return 0.5 * (_lugannani_rice(above, scaled) + _lugannani_rice(below, scaled))
    return _lugannani_rice(target, scaled)


def _lugannani_rice(target: float, weights: Array) -> float:
    def slope(at: float) -> float:
        return float(np.sum(weights / (1.0 - 2.0 * weights * at))) - target

    low, high = -1.0, 0.5 * (1.0 - 1e-12)
    while slope(low) > 0.0:
        low *= 2.0
    if slope(high) < 0.0:
        return 0.0
    at = float(brentq(slope, low, high, xtol=1e-14))
    left = 1.0 - 2.0 * weights * at
    grown = -0.5 * float(np.sum(np.log(left)))
    w = np.sign(at) * np.sqrt(max(2.0 * (at * target - grown), 0.0))
    v = at * np.sqrt(2.0 * float(np.sum((weights / left) ** 2)))
    if w == 0.0 or v == 0.0:
        return 0.5
    return float(np.clip(ndtr(-(w + np.log(v / w) / w)), 0.0, 1.0))
