"""Chances of several tests that are read together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def holm_adjusted(chances: Array) -> Array:
    """Chances of several tests, each for as many as are no smaller.

    One at or below a level stands with at most that chance of any false one among them, however
    the tests depend on each other.

    Parameters
    ----------
    chances : ndarray
        Chance of each test alone, shape (tests,).

    Returns
    -------
    ndarray
        Adjusted chances, shape (tests,), none above 1.

    Reference
    ---------
    Holm, "A simple sequentially rejective multiple test procedure", *Scandinavian Journal of
    Statistics* 6 (1979).

    Example
    -------
    >>> holm_adjusted(np.array([0.01, 0.5, 0.02])).tolist()
    [0.03, 0.5, 0.04]
    """
    order = np.argsort(chances)
    ranked = np.maximum.accumulate(np.arange(len(chances), 0, -1) * chances[order])
    adjusted = np.empty_like(ranked)
    adjusted[order] = ranked
    return np.minimum(adjusted, 1.0)
