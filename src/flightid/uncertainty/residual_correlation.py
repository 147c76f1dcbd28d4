"""Normalised correlation functions, their bands, and the portmanteau statistic.

A series is a tuple of arrays, one for each record: means are taken within a record, no lag spans
two records, and all records count as one sample of their total length.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError, ShapeError
from flightid.uncertainty.periodograms import periodogram
from flightid.uncertainty.quantiles import half_width
from flightid.uncertainty.residual_noise import (
    LARGEST_ORDER,
    autoregression,
)

Array = NDArray[np.float64]
Series = tuple[Array, ...]

LEVEL = 0.95
"""Share of sound residuals that stay within the bounds of a correlation."""
FEW = 128
"""Lags up to which sums of products take less than transforms."""
SMALLEST_EIGENVALUE = 1e-3
"""Directions of lags with a smaller share of the largest variance carry no evidence."""


def centred(series: Series) -> Series:
    """Each record of a series with its own mean removed."""
    return tuple(record - np.mean(record) for record in series)


def cross_correlation(a: Series, b: Series, maximum_lag: int) -> Array:
    """Normalised cross-correlation of two series about their means.

    ``r(tau) = sum_t a(t - tau) b(t) / sqrt(sum a² sum b²)``: at positive lags a came first. One
    norm serves all lags, so ``|r| <= 1`` and the correlation matrix stays positive.

    Parameters
    ----------
    a, b : tuple of ndarray, each shape (n_samples,)
        One array for each record, of the same lengths in both.
    maximum_lag : int
        Largest lag, in samples.

    Returns
    -------
    ndarray, shape (2 maximum_lag + 1,)
        Lags ``-maximum_lag`` to ``maximum_lag``.

    Raises
    ------
    ShapeError
        Lengths that differ.
    OptionError
        A lag that the shortest record does not hold.
    DataError
        A series that does not change.

    Reference
    ---------
    Billings & Voon (1986), Correlation based model validity tests for non-linear models,
    Int. J. Control 44(1).

    Example
    -------
    >>> step = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    >>> int(np.argmax(cross_correlation((step,), (np.roll(step, 1),), 2))) - 2
    1
    """
    lengths = [record.size for record in a]
    if lengths != [record.size for record in b] or not lengths:
        raise ShapeError(
            "two series do not fit", found=[record.size for record in b], needed=lengths
        )
    if not 0 <= maximum_lag < min(lengths):
        raise OptionError(
            "the largest lag does not lie within a record",
            found=maximum_lag,
            needed=f"0 to {min(lengths) - 1}",
        )
    first, second = centred(a), centred(b)
    power = _power(first) * _power(second)
    if not power > 0.0:
        raise DataError("a series does not change", needed="a correlation needs variation")
    total = np.zeros(2 * maximum_lag + 1)
    for x, y in zip(first, second, strict=True):
        if total.size <= FEW:
            total += np.correlate(np.pad(y, maximum_lag), x, mode="valid")
            continue
        length = scipy.fft.next_fast_len(x.size + maximum_lag, real=True)
        ring = scipy.fft.irfft(
            np.conj(scipy.fft.rfft(x, length)) * scipy.fft.rfft(y, length), length
        )
        total += np.concatenate((ring[length - maximum_lag :], ring[: maximum_lag + 1]))
    return np.asarray(total / np.sqrt(power))


def autocorrelation(a: Series, n_lags: int) -> Array:
    """Correlations of a series with itself from lag zero; zero beyond the shortest record.

    Example
    -------
    >>> autocorrelation((np.array([1.0, -1.0, 1.0, -1.0]),), 2)
    array([ 1.  , -0.75])
    """
    reach = min(n_lags, *(record.size for record in a)) - 1
    found = np.zeros(n_lags)
    found[: reach + 1] = cross_correlation(a, a, reach)[reach:]
    return found


def lag_covariance(a: Series, b: Series, n_lags: int) -> Array:
    """Covariance of the cross-correlations of independent series, times the number of samples.

    ``N cov(r(tau), r(tau + d)) = sum_k rho_aa(k) rho_bb(k + d)``; its first value gives the
    Bartlett band, and one for a white b. The colour of b comes from an autoregressive model.

    Parameters
    ----------
    a, b : tuple of ndarray, each shape (n_samples,)
        One array for each record.
    n_lags : int
        Number of lag differences d, from zero.

    Returns
    -------
    ndarray, shape (n_lags,)

    Reference
    ---------
    Box, Jenkins & Reinsel, Time Series Analysis, 4th ed., chapter 12 (Bartlett's formula);
    Ljung, System Identification, 2nd ed., section 16.6.

    Example
    -------
    >>> rng = np.random.default_rng(0)
    >>> one, two = ((rng.standard_normal(4000),) for _ in range(2))
    >>> abs(lag_covariance(one, two, 2)).round(1)
    array([1., 0.])
    """
    reach = min(record.size for record in a) - 1
    whole = np.concatenate(centred(b))[:, None]
    model = autoregression(periodogram(whole), whole.size)
    if model.is_white:
        return autocorrelation(a, n_lags)
    of_a = cross_correlation(a, a, reach)
    # Records may be shorter than the model's order, whose own lags it always gives.
    modelled = model.autocovariance(max(reach, LARGEST_ORDER) + 1)[: reach + 1]
    # Scaled by its own first value, so that a white b leaves the autocorrelation of a untouched.
    of_b = np.concatenate((modelled[:0:-1], modelled)) / modelled[0]
    found = [of_a[lag:] @ of_b[: of_b.size - lag] for lag in range(min(n_lags, of_a.size))]
    return np.pad(found, (0, n_lags - len(found)))


def white_portmanteau(values: Array, n_samples: int, fitted: int) -> tuple[float, int, float]:
    """Ljung and Box's statistic of correlations at lags from one, its degrees and its p-value.

    Parameters
    ----------
    values : ndarray, shape (n_lags,)
        Correlations at lags 1, 2, ...
    n_samples : int
        Number of samples.
    fitted : int
        Parameters of the noise model that were fitted to these samples.

    Returns
    -------
    tuple of float, int and float
        Statistic, degrees of freedom, and p-value under whiteness.

    Reference
    ---------
    Ljung & Box (1978), On a measure of lack of fit in time series models, Biometrika 65(2).

    Example
    -------
    >>> white_portmanteau(np.array([0.0, 0.0]), 100, 0)
    (0.0, 2, 1.0)
    """
    weights = 1.0 / (n_samples - np.arange(1, values.size + 1))
    statistic = float(n_samples * (n_samples + 2) * (values**2 @ weights))
    degrees = values.size - fitted
    return statistic, degrees, float(scipy.special.chdtrc(degrees, statistic))


def independence_portmanteau(
    values: Array, covariance: Array, n_samples: int, fitted: int
) -> tuple[float, int, float]:
    """Quadratic form of cross-correlations in the inverse of their covariance.

    Correlations with a coloured input hang together from lag to lag, so a plain sum of squares has
    no chi-square distribution; directions of lags in which the input has no power are left out.

    Parameters
    ----------
    values : ndarray, shape (n_lags,)
        Correlations at neighbouring lags.
    covariance : ndarray, shape (at least n_lags,)
        Of `lag_covariance`.
    n_samples : int
        Number of samples.
    fitted : int
        Parameters of the input's part of the model that were fitted to these samples.

    Returns
    -------
    tuple of float, int and float
        Statistic, degrees of freedom (below one: too few directions), and p-value.

    Reference
    ---------
    Ljung, System Identification, 2nd ed., section 16.6.

    Example
    -------
    >>> statistic, degrees, _ = independence_portmanteau(
    ...     np.array([0.1, 0.0]), np.array([1.0, 0.0]), 100, 0)
    >>> round(statistic, 9), degrees
    (1.0, 2)
    """
    spread, directions = scipy.linalg.eigh(scipy.linalg.toeplitz(covariance[: values.size]))
    kept = spread > SMALLEST_EIGENVALUE * spread[-1]
    along = directions[:, kept].T @ values
    statistic = float(n_samples * np.sum(along**2 / spread[kept]))
    degrees = int(np.count_nonzero(kept)) - fitted
    return statistic, degrees, float(scipy.special.chdtrc(max(degrees, 1), statistic))


def pointwise_factor() -> float:
    """Half-width of the pointwise band in standard errors, 1.96."""
    return half_width(LEVEL)


def simultaneous_factor(n_lags: int) -> float:
    """Half-width, in standard errors, of the band that holds all of n independent lags in 95 %.

    Reference
    ---------
    Šidák (1967), Rectangular confidence regions for the means of multivariate normal
    distributions, J. Am. Statistical Association 62.

    Example
    -------
    >>> round(simultaneous_factor(25), 3)
    3.083
    """
    return half_width(LEVEL ** (1.0 / n_lags))


def exceedance_limit(n_lags: int) -> int:
    """Most lags outside the pointwise band that chance explains in 95 % of cases.

    Example
    -------
    >>> exceedance_limit(25), exceedance_limit(51)
    (3, 5)
    """
    return int(
        np.searchsorted(scipy.special.bdtr(np.arange(n_lags + 1), n_lags, 1.0 - LEVEL), LEVEL)
    )


def _power(series: Series) -> float:
    return float(sum(record @ record for record in series))
