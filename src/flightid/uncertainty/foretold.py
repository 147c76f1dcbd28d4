"""How much of an output a failed residual test is about: significant is not yet large.

A long record makes any test fail, for no model of a real vehicle is exact. What the failure is
worth is the part of the residual that could have been foretold, beside the size of the output.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.uncertainty.residual_correlation import SMALLEST_EIGENVALUE

Array = NDArray[np.float64]
NEGLIGIBLE_PERCENT = 2.0
"""Of an output's standard deviation: what is missed below that shows in no use of a model."""
MATERIAL_PERCENT = 10.0
"""Of an output's standard deviation: what is missed from there on shows in a prediction."""
LONGEST = 10
"""Of a record's length over the longest lag that is looked at."""


def share_from_past(values: Array, n_samples: int) -> float:
    """Share of a residual's power that its own past foretells, less what chance gives.

    Parameters
    ----------
    values : ndarray, shape (n_lags,)
        Its correlations at lags 1, 2, ...
    n_samples : int

    Returns
    -------
    float
        0 to 1.

    Reference
    ---------
    Box, Jenkins & Reinsel, Time Series Analysis, 4th ed., section 3.2 (Yule–Walker equations).

    Example
    -------
    >>> round(share_from_past(0.9 ** np.arange(1.0, 11.0), 10_000), 2)
    0.81
    """
    known = np.concatenate(([1.0], values[:-1]))
    weights = scipy.linalg.lstsq(scipy.linalg.toeplitz(known), values)[0]
    return _within(float(values @ weights) - values.size / n_samples)


def share_from_inputs(values: Array, own: Array, covariance: Array, n_samples: int) -> float:
    """Share of a residual's power that an input foretells, less what chance gives.

    Parameters
    ----------
    values : ndarray, shape (n_lags,)
        Correlations of input and residual at neighbouring lags.
    own : ndarray, shape (at least n_lags,)
        Autocorrelation of the input from lag zero.
    covariance : ndarray, shape (at least n_lags,)
        Of `lag_covariance`: what chance gives with a coloured residual.
    n_samples : int

    Returns
    -------
    float
        0 to 1.

    Reference
    ---------
    Ljung, System Identification, 2nd ed., section 16.6.

    Example
    -------
    >>> white = np.array([1.0, 0.0])
    >>> round(share_from_inputs(np.array([0.5, 0.0]), white, white, 10_000), 3)
    0.25
    """
    spread, directions = scipy.linalg.eigh(scipy.linalg.toeplitz(own[: values.size]))
    kept = spread > SMALLEST_EIGENVALUE * spread[-1]
    along = directions[:, kept]
    found = (along.T @ values) ** 2
    chance = np.sum(along * (scipy.linalg.toeplitz(covariance[: values.size]) @ along), axis=0)
    return _within(float(np.sum((found - chance / n_samples) / spread[kept])))


def share_of_lags(values: Array, n_samples: int) -> float:
    """Share of power behind independent correlations, less what chance gives.

    Example
    -------
    >>> round(share_of_lags(np.array([0.5, 0.0]), 10_000), 3)
    0.25
    """
    return _within(float(values @ values) - values.size / n_samples)


def percent_of_output(share: float, residual: float, output: float) -> float | None:
    """Root mean square that is foretold, in percent of that of the output; None for no output.

    Example
    -------
    >>> percent_of_output(0.25, 0.2, 1.0)
    10.0
    """
    return 100.0 * math.sqrt(share) * residual / output if output > 0.0 else None


def is_material(percent: float | None) -> bool:
    """Whether a failure counts as large; where the output is not known it does.

    Example
    -------
    >>> is_material(0.5), is_material(12.0), is_material(None)
    (False, True, True)
    """
    return percent is None or percent >= MATERIAL_PERCENT


def independent_share(row: Array) -> float:
    """Share of samples that count, by the first autocorrelation.

    Example
    -------
    >>> round(independent_share(np.tile([1.0, -1.0], 50)), 3)
    1.0
    """
    power = float(row @ row)
    first = float(row[1:] @ row[:-1]) / power if power > 0.0 else 0.0
    return (1.0 - max(first, 0.0)) / (1.0 + max(first, 0.0))


def chance_share(row: Array) -> float:
    """Share of samples that count where something else of its colour may explain it by chance.

    1/(1 + 2 Σ ρ²). Smooth noise is far from what its first correlation alone makes of it.

    Reference
    ---------
    Bartlett, Journal of the Royal Statistical Society 98 (1935), 536–543; Box, Jenkins & Reinsel,
    Time Series Analysis, 4th ed., section 12.1.

    Example
    -------
    >>> white = np.random.default_rng(0).standard_normal(4000)
    >>> smooth = scipy.signal.lfilter([1.0], np.poly([0.9, 0.9]), white)
    >>> round(chance_share(white), 1), round(chance_share(1e200 * smooth), 2)
    (0.9, 0.03)
    """
    lags = own_lags(row, max(row.size // LONGEST, 2) - 1)
    return 1.0 / (2.0 * float(lags @ lags) / float(lags[0]) ** 2 - 1.0) if lags[0] > 0.0 else 1.0


def independent_samples(rows: Sequence[Array]) -> float:
    """Samples that tell the power of a coloured series as well as so many independent ones.

    ``n / sum_k rho(k)²``, over lags up to a quarter of the series; one at least.

    Example
    -------
    >>> white = np.random.default_rng(0).standard_normal(4000)
    >>> slow = np.repeat(white[:400], 10)
    >>> 2500 < independent_samples([white]) <= 4000, 300 < independent_samples([slow]) < 700
    (True, True)
    """
    return max(sum(_independent(row) for row in rows), 1.0)


def _independent(row: Array) -> float:
    n = row.size
    lags = own_lags(row, n // 4)
    if not lags[0] > 0.0:
        return float(n)
    # What chance leaves of lags without correlation counts for none.
    rho = np.square(lags[1:] / lags[0])
    return n / (1.0 + 2.0 * float(np.sum(np.maximum(rho - 1.0 / n, 0.0))))


def own_lags(row: Array, last: int) -> Array:
    """Sums of products with itself at lags 0 to `last`, over that of a power of two about it.

    Parameters
    ----------
    row : ndarray, shape (n,)
    last : int

    Example
    -------
    >>> bool(np.all(own_lags(np.zeros(9), 3) == 0.0))
    True
    >>> row = np.array([3.0, 1.0, 0.0, -2.0])
    >>> [(16.0 * own_lags(size * row, 2)).round(9).tolist() for size in (1.0, 2.0**-600, 2.0**600)]
    [[14.0, 3.0, -2.0], [14.0, 3.0, -2.0], [14.0, 3.0, -2.0]]
    """
    # Squares of very large and very small numbers are none.
    row = np.ldexp(row, -np.frexp(np.max(np.abs(row), initial=0.0))[1])
    length = scipy.fft.next_fast_len(row.size + last, real=True)
    power = np.abs(scipy.fft.rfft(row, length)) ** 2
    return np.asarray(scipy.fft.irfft(power, length)[: last + 1])


def likelihood_gain(
    before: Sequence[Array],
    after: Sequence[Array],
    share: Callable[[Array], float] = independent_share,
) -> float:
    """½ n ln(power before / after), n the independent samples of what is left after.

    Parameters
    ----------
    before, after : sequence of ndarray, shape (n_samples,)
        Residuals of one output, by record.
    share : callable
        Of a residual's samples that count.

    Example
    -------
    >>> white = np.random.default_rng(0).standard_normal(2000)
    >>> round(likelihood_gain([2.0 * white], [white]) / 2000.0, 1)
    0.7
    """
    tiny = float(np.finfo(float).tiny)
    power = [max(sum(float(row @ row) for row in rows), tiny) for rows in (before, after)]
    count = sum(row.size * share(row) for row in after)
    return 0.5 * count * (math.log(power[0]) - math.log(power[1]))


def expected_gain(
    moved: Sequence[Array],
    left: Sequence[Array],
    share: Callable[[Array], float] = independent_share,
) -> float:
    """What `likelihood_gain` is on average where the right model stands against a wrong one.

    ½ n (power of their difference / power left by the right one), n as there. The gain scatters
    about it by the square root of twice its size, and about less of it where the other is right.

    Parameters
    ----------
    moved : sequence of ndarray, shape (n_samples,)
        Difference of the two in one output, by record.
    left : sequence of ndarray, shape (n_samples,)
        Residuals of the right one.
    share : callable
        Of a residual's samples that count.

    Reference
    ---------
    Cox, Proc. 4th Berkeley Symposium 1 (1961), 105-123.

    Example
    -------
    >>> white = np.random.default_rng(0).standard_normal(2000)
    >>> line = np.full(2000, 0.1)
    >>> round(expected_gain([line], [white]), 1), round(likelihood_gain([white + line], [white]), 1)
    (10.0, 4.4)
    """
    tiny = float(np.finfo(float).tiny)
    away, rest = (sum(float(row @ row) for row in rows) for rows in (moved, left))
    return 0.5 * sum(row.size * share(row) for row in left) * away / max(rest, tiny)


def _within(share: float) -> float:
    return min(max(share, 0.0), 1.0)
