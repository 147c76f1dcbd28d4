"""Whether one signal rises with another, whatever its curve: Spearman's correlation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flightid.uncertainty.student import student_chance

Array = NDArray[np.float64]


def rank_correlation(first: Array, second: Array) -> tuple[float, float]:
    """Spearman's rank correlation, and the chance of one as large where there is none.

    Parameters
    ----------
    first, second : ndarray, shape (n,)
        Three samples or more.

    Returns
    -------
    float, float
        NaN where a signal stands still.

    Reference
    ---------
    Kendall & Stuart, *The Advanced Theory of Statistics*, vol. 2, §31.19: ties share their ranks;
    the chance by Student's t of n − 2 degrees of freedom.

    Example
    -------
    >>> found = rank_correlation(np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 4.0, 9.0, 8.0]))
    >>> round(found[0], 3), round(found[1], 3)
    (0.8, 0.2)
    """
    if np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        return np.nan, np.nan
    rank = float(np.corrcoef(_ranks(first), _ranks(second))[0, 1])
    freedom = len(first) - 2
    left = max((1.0 - rank) * (1.0 + rank), 0.0)
    if left == 0.0:
        return rank, 0.0
    return rank, student_chance(abs(rank) * math.sqrt(freedom / left), freedom)


def _ranks(values: Array) -> Array:
    """Places in order, from one; equal values share the mean of theirs."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return np.asarray((last - (counts - 1) / 2.0)[place], dtype=np.float64)
