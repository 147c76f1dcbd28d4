"""Tests beside a spread that few days told: by Student's t instead of the normal distribution."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from flightid.uncertainty.quantiles import normal_quantiles

Array = NDArray[np.float64]
LEAST = 1e-300
"""Chance below which all are as rare."""


def as_normal(deviations: Array, freedom: float) -> Array:
    """Sizes of normal numbers that are as rare as these of Student's t.

    Parameters
    ----------
    deviations : ndarray
        In standard errors, of any sign.
    freedom : float
        Degrees of freedom of the variance; infinite where it is known.

    Example
    -------
    >>> as_normal(np.array([-3.0, 1.0]), 10.0).round(3).tolist()
    [2.474, 0.952]
    """
    sizes = np.abs(deviations)
    if np.isinf(freedom):
        return np.asarray(sizes)
    return np.asarray(-normal_quantiles(np.maximum(stdtr(freedom, -sizes), LEAST)))


def beside_spread(chance: float, freedom: float) -> float:
    """A chance by known variances, as it is beside variances of so much freedom.

    Of a sum of squares, taken for the square of the normal number that is as rare.

    Example
    -------
    >>> round(beside_spread(0.05, 10.0), 4), beside_spread(0.05, np.inf)
    (0.0784, 0.05)
    """
    if np.isinf(freedom):
        return chance
    return float(2.0 * stdtr(freedom, float(normal_quantiles(0.5 * chance))))
