"""Whether one of two models errs more than the other along the same samples, beyond chance."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.uncertainty.foretold import own_lags

Array = NDArray[np.floating]
LAGS = 4
"""Of a record's length over the longest lag at which errors are taken to be alike."""
KNOWN = 2
"""Independent samples that a correlation's error takes away, levels known to be zero."""
HIGHEST = 1.0 - 1e-12
"""Correlation of which a score is still a number."""


def excess_score(errors: Sequence[Array], others: Sequence[Array]) -> float:
    """Standard normal score of a mean square that is larger than another of paired errors.

    Both hold the same noise, so that a ratio of their variances sees little of what tells them
    apart. Sum and difference of the errors are correlated where their mean squares differ, and only
    there (Pitman, Morgan); a correlation of coloured series scatters as one of fewer samples does,
    ``n / (1 + 2 Σ ρ_sum ρ_difference)`` (Bartlett). Errors have no level but their own: none is
    taken off.

    Parameters
    ----------
    errors, others : sequence of ndarray, shape (n_samples,)
        Of the two models by record; of one that is longer the last samples count.

    Returns
    -------
    float
        Positive where `errors` are the larger ones; 0 for too few samples or equal errors.

    Reference
    ---------
    Pitman, Biometrika 31 (1939), 9-12; Morgan, ibid., 13-19; Bartlett, Journal of the Royal
    Statistical Society 98 (1935), 536-543; Fisher, Metron 1 (1921), 3-32.

    Example
    -------
    >>> noise, miss = np.random.default_rng(0).standard_normal((2, 1000))
    >>> round(excess_score([noise + 0.2 * miss], [noise]), 1)
    5.2
    >>> slow = np.repeat(noise[:20], 50)
    >>> round(excess_score([slow + 0.2 * np.repeat(miss[:20], 50)], [slow]), 1)
    1.5
    """
    together, apart, both, count = 0.0, 0.0, 0.0, 0.0
    for one, other in zip(errors, others, strict=True):
        n = min(one.size, other.size)
        first, second = (np.asarray(row[row.size - n :], np.float64) for row in (one, other))
        total, difference = first + second, first - second
        together += float(total @ total)
        apart += float(difference @ difference)
        both += float(total @ difference)
        count += n / _memory(total, difference)
    size = math.sqrt(together) * math.sqrt(apart)
    if not size > 0.0:
        return 0.0
    correlation = min(max(both / size, -HIGHEST), HIGHEST)
    return math.atanh(correlation) * math.sqrt(max(count - KNOWN, 0.0))


def _memory(one: Array, other: Array) -> float:
    """Samples for each one that counts in the correlation of two series, 1 at least."""
    last = one.size // LAGS
    known = [_own_correlations(row, last) for row in (one, other)]
    return max(1.0 + 2.0 * float(known[0] @ known[1]), 1.0)


def _own_correlations(row: Array, last: int) -> Array:
    """Correlations at lags 1 to `last`; zero where there is nothing."""
    sums = own_lags(np.asarray(row, np.float64), last)
    return np.asarray(sums[1:] / sums[0] if sums[0] > 0.0 else np.zeros(last))
