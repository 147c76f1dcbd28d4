"""Whether a pulse response has ended: chance explains its last lags."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
LEVEL = 0.95
"""Of all tests of a response together."""
SMOOTH = 2
"""Powers of the lag, from zero, that a slow tail is tested for."""
SHORTEST_PERIODOGRAM = 8
"""Fewer lags hold no period that mean and slope would miss."""


def vanishes(
    values: Array, covariance: Array, start: int, count: int, *, each: bool = True
) -> bool:
    """Whether chance explains the lags from `start` on: `each`, as a slow tail, as a mode.

    All lags together have no power against a tail that is small everywhere, of one sign or ringing;
    contrasts have (Scheffé, *The Analysis of Variance*, section 3.5): mean and slope, and cosine
    and sine of the frequency that is strongest in as many lags before, where faster modes have
    died. Each test has its part of the level.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Response by lag, in the output's unit per unit of the input.
    covariance : ndarray, shape (n, n)
        Of its errors.
    start : int
        First lag that should be zero.
    count : int
        Responses that share the level.
    each : bool
        Test all lags together too.

    Example
    -------
    >>> vanishes(np.array([9.0, 3.0, 0.1]), np.eye(3), 2, 1)
    True
    >>> vanishes(np.array([9.0, 3.0, 9.0]), np.eye(3), 2, 1)
    False
    """
    tail, spread = values[start:], covariance[start:, start:]
    last = tail.size
    smooth = np.vander(np.linspace(-1.0, 1.0, last), min(SMOOTH, last))
    contrasts = [np.eye(last), smooth] if each else [smooth]
    if last >= SHORTEST_PERIODOGRAM:
        angles = _strongest(values[max(start - last, 0) : start]) * np.arange(last)
        contrasts.append(np.column_stack([np.cos(angles), np.sin(angles)]))
    level = (1.0 - LEVEL) / (len(contrasts) * count)
    return all(_chance(row.T @ tail, row.T @ spread @ row) >= level for row in contrasts)


def _strongest(values: Array) -> float:
    """Frequency of the largest ordinate of the periodogram but the mean's, in rad a sample."""
    padded = 4 * values.size
    power = np.abs(np.fft.rfft(values - values.mean(), padded)) ** 2
    return 2.0 * np.pi * int(np.argmax(power)) / padded


def _chance(values: Array, covariance: Array) -> float:
    """Probability of values as large, if they are zero."""
    inverse = np.linalg.pinv(covariance, hermitian=True)
    return float(scipy.special.chdtrc(values.size, float(values @ inverse @ values)))
