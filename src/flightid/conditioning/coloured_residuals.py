"""Covariance of least-squares estimates whose residuals are coloured.

The usual inverse information assumes white residuals. Residuals of flight data are not: gyro noise
integrates into slow drifts. Here each output's residual gets an autoregressive model (order by the
Bayesian information criterion), whose autocovariance stands for the noise in
``D [sum_ij s_i R(i - j) s_j'] D``. Sample autocovariances alone would give too little: the fit has
already taken out of the residuals what lies along the sensitivities.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal

Array = NDArray[np.float64]
LARGEST_ORDER = 20


def autocovariance(residual: Array, n_lags: int) -> Array:
    """Autocovariance of a residual by an autoregressive model, lags 0 to ``n_lags - 1``.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Residual of one output.
    n_lags : int
        Number of lags.

    Returns
    -------
    ndarray, shape (n_lags,)
        In the square of the residual's unit.

    Reference
    ---------
    Brockwell & Davis, Time Series: Theory and Methods (2nd ed.), sections 8.1-8.2 (Yule-Walker).

    Example
    -------
    >>> white = np.random.default_rng(0).standard_normal(4000)
    >>> autocovariance(white, 3).round(1)
    array([1., 0., 0.])
    """
    n = residual.size
    largest = min(LARGEST_ORDER, n // 20, n_lags - 1)
    sample = np.array([float(residual[: n - k] @ residual[k:]) / n for k in range(largest + 1)])
    weights = _autoregression(sample, n)
    result = np.zeros(n_lags)
    order = weights.size
    result[: order + 1] = sample[: order + 1]
    if order:
        # Beyond its order the model continues its autocovariance by its own recursion.
        denominator = np.concatenate(([1.0], -weights))
        state = signal.lfiltic([1.0], denominator, y=result[order:0:-1])
        result[order + 1 :] = signal.lfilter(
            [1.0], denominator, np.zeros(n_lags - order - 1), zi=state
        )[0]
    return result


def _autoregression(sample: Array, n: int) -> Array:
    """Weights of the best autoregression by Levinson's recursion over the orders."""
    trial = best = np.empty(0)
    innovation = float(sample[0])
    criterion = n * np.log(innovation) if innovation > 0 else -np.inf
    for order in range(1, sample.size):
        # A residual that predicts itself to rounding has no further order.
        if not innovation > 1e-12 * sample[0]:
            break
        reflection = float(sample[order] - trial @ sample[order - 1 : 0 : -1]) / innovation
        trial = np.concatenate((trial - reflection * trial[::-1], [reflection]))
        innovation *= 1 - reflection**2
        worth = n * np.log(max(innovation, 1e-300)) + order * np.log(n)
        if worth < criterion:
            criterion, best = worth, trial
    return best


def corrected_covariance(slopes: Array, residuals: Array, deviations: Array) -> tuple[Array, Array]:
    """Covariance for white residuals, and the one corrected for their colour.

    Parameters
    ----------
    slopes : ndarray, shape (n_outputs, n, n_parameters)
        Derivatives of the outputs by the parameters.
    residuals : ndarray, shape (n_outputs, n)
        Residuals.
    deviations : ndarray, shape (n_outputs,)
        Standard deviations by which the fit weighed the outputs.

    Returns
    -------
    white, corrected : ndarray, shape (n_parameters, n_parameters)

    Reference
    ---------
    Morelli & Klein (1997), Accuracy of aerodynamic model parameters estimated from flight test
    data, J. Guidance, Control and Dynamics 20(1), eqs. 19-25.

    Example
    -------
    >>> slopes = np.ones((1, 400, 1))
    >>> residuals = np.random.default_rng(1).standard_normal((1, 400))
    >>> white, corrected = corrected_covariance(slopes, residuals, np.ones(1))
    >>> float(white[0, 0])
    0.0025
    """
    n, n_parameters = slopes.shape[1:]
    information = np.zeros((n_parameters, n_parameters))
    middle = np.zeros((n_parameters, n_parameters))
    for slope, residual, deviation in zip(slopes, residuals, deviations, strict=True):
        scaled = slope / deviation**2
        information += slope.T @ scaled
        middle += scaled.T @ _toeplitz_product(autocovariance(residual, n), scaled)
    # Columns differ by many orders of magnitude: scale them before inverting.
    size = np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information / np.outer(size, size)) / np.outer(size, size)
    return inverse, inverse @ middle @ inverse * n / (n - n_parameters / len(residuals))


def _toeplitz_product(first: Array, columns: Array) -> Array:
    """Product of a symmetric Toeplitz matrix with columns, by one circulant of twice the size."""
    n = first.size
    length = fft.next_fast_len(2 * n, real=True)
    ring = np.zeros(length)
    ring[:n] = first
    ring[length - n + 1 :] = first[:0:-1]
    spectrum = fft.rfft(ring)[:, None] * fft.rfft(columns, length, axis=0)
    return np.asarray(fft.irfft(spectrum, length, axis=0)[:n])
