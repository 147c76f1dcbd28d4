"""Agreement of a prediction with a measurement, one number for each channel.

Conventions: arrays are (n_channels, n_samples) or (n_samples,), time last; the result has the
shape without the last axis. Nothing here removes a mean unless it says so.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flightid.errors import DataError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def theil(measured: ArrayLike, predicted: ArrayLike) -> NDArray[np.float64]:
    """Theil's inequality coefficient: 0 is perfect, 1 is no resemblance.

    ``TIC = rms(y - y_hat) / (rms(y) + rms(y_hat))``; guide: at most 0.25 to 0.30.

    Parameters
    ----------
    measured, predicted : array_like, shape (..., n_samples)
        Changes about trim: an offset common to both flatters the number.

    Returns
    -------
    ndarray, shape (...)

    Raises
    ------
    ShapeError
        The shapes differ.
    DataError
        A sample is not finite, or both signals are zero throughout.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., eq. 14.8;
    Jategaonkar, Flight Vehicle System Identification, eq. 11.10.

    Example
    -------
    >>> float(theil([1.0, -1.0], [0.5, -0.5])) == 1 / 3
    True
    """
    y, y_hat = _pair(measured, predicted)
    total = _rms(y) + _rms(y_hat)
    _require_power(total, "both signals are zero throughout")
    return np.asarray(_rms(y - y_hat) / total)


def rms_error(measured: ArrayLike, predicted: ArrayLike) -> NDArray[np.float64]:
    """Root mean square of the error, in the channel's unit.

    Parameters
    ----------
    measured, predicted : array_like, shape (..., n_samples)
        Signals.

    Returns
    -------
    ndarray, shape (...)

    Raises
    ------
    ShapeError
        The shapes differ.
    DataError
        A sample is not finite.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., section 14.4.

    Example
    -------
    >>> float(rms_error([1.0, 3.0], [0.0, 2.0]))
    1.0
    """
    y, y_hat = _pair(measured, predicted)
    return _rms(y - y_hat)


def mse(measured: ArrayLike, predicted: ArrayLike) -> NDArray[np.float64]:
    """Mean square of the error, in the channel's unit squared.

    Parameters
    ----------
    measured, predicted : array_like, shape (..., n_samples)
        Signals.

    Returns
    -------
    ndarray, shape (...)

    Raises
    ------
    ShapeError
        The shapes differ.
    DataError
        A sample is not finite.

    Reference
    ---------
    Ljung, System Identification, 2nd ed., section 16.4.

    Example
    -------
    >>> float(mse([1.0, 3.0], [0.0, 0.0]))
    5.0
    """
    y, y_hat = _pair(measured, predicted)
    return np.asarray(np.mean((y - y_hat) ** 2, axis=-1))


def fit_percent(measured: ArrayLike, predicted: ArrayLike) -> NDArray[np.float64]:
    """Percentage of the measured variation that is explained, by norms.

    ``100 (1 - ||y - y_hat|| / ||y - mean(y)||)``; 100 is perfect, 0 no better than the mean.

    Parameters
    ----------
    measured, predicted : array_like, shape (..., n_samples)
        Signals.

    Returns
    -------
    ndarray, shape (...)
        Percent; negative for a prediction that is worse than the mean.

    Raises
    ------
    ShapeError
        The shapes differ.
    DataError
        A sample is not finite, or the measurement is constant.

    Reference
    ---------
    Ljung, System Identification, 2nd ed., section 16.4.

    Example
    -------
    >>> float(fit_percent([1.0, -1.0], [0.5, -0.5]))
    50.0
    """
    y, y_hat = _pair(measured, predicted)
    spread = np.std(y, axis=-1)
    _require_power(spread, "the measured signal is constant")
    return np.asarray(100.0 * (1.0 - _rms(y - y_hat) / spread))


def r_squared(measured: ArrayLike, predicted: ArrayLike) -> NDArray[np.float64]:
    """Coefficient of determination ``1 - sum((y - y_hat)²) / sum((y - mean(y))²)``.

    Parameters
    ----------
    measured, predicted : array_like, shape (..., n_samples)
        Signals.

    Returns
    -------
    ndarray, shape (...)
        At most 1; negative for a prediction that is worse than the mean.

    Raises
    ------
    ShapeError
        The shapes differ.
    DataError
        A sample is not finite, or the measurement is constant.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, eq. 5.33.

    Example
    -------
    >>> float(r_squared([1.0, -1.0], [0.5, -0.5]))
    0.75
    """
    return np.asarray(1.0 - (1.0 - fit_percent(measured, predicted) / 100.0) ** 2)


def vaf_percent(measured: ArrayLike, predicted: ArrayLike) -> NDArray[np.float64]:
    """Variance accounted for, ``100 (1 - var(y - y_hat) / var(y))``: blind to a constant error.

    Parameters
    ----------
    measured, predicted : array_like, shape (..., n_samples)
        Signals.

    Returns
    -------
    ndarray, shape (...)
        Percent.

    Raises
    ------
    ShapeError
        The shapes differ.
    DataError
        A sample is not finite, or the measurement is constant.

    Reference
    ---------
    Verhaegen & Verdult, Filtering and System Identification, eq. 10.14.

    Example
    -------
    >>> float(vaf_percent([1.0, -1.0], [6.0, 4.0]))
    100.0
    """
    y, y_hat = _pair(measured, predicted)
    spread = np.var(y, axis=-1)
    _require_power(spread, "the measured signal is constant")
    return np.asarray(100.0 * (1.0 - np.var(y - y_hat, axis=-1) / spread))


def weighted_rms(
    measured: ArrayLike, predicted: ArrayLike, weights: ArrayLike
) -> NDArray[np.float64]:
    """Root mean square of the weighted errors over all channels.

    ``J_rms = sqrt(sum (y - y_hat)' W (y - y_hat) / (n_samples n_channels))``; with the weights of
    a degree, a degree per second, a foot per second and a foot per second squared the guide is
    at most 1 to 2.

    Parameters
    ----------
    measured, predicted : array_like, shape (n_channels, n_samples)
        Signals.
    weights : array_like, shape (n_channels,)
        Diagonal of W: the square of what one unit of error counts.

    Returns
    -------
    ndarray, shape ()

    Raises
    ------
    ShapeError
        Shapes differ, or not one weight for each channel.
    DataError
        A sample is not finite.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., eq. 14.6.

    Example
    -------
    >>> float(weighted_rms([[1.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]], [8.0, 1.0]))
    2.0
    """
    y, y_hat = _pair(measured, predicted)
    diagonal = np.asarray(weights, dtype=np.float64)
    if y.ndim != 2 or diagonal.shape != y.shape[:1]:
        raise ShapeError(
            "weights do not fit the channels", found=diagonal.shape, needed=y.shape[:1]
        )
    return np.asarray(np.sqrt(np.mean(diagonal[:, None] * (y - y_hat) ** 2)))


def _pair(
    measured: ArrayLike, predicted: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    y = np.asarray(measured, dtype=np.float64)
    y_hat = np.asarray(predicted, dtype=np.float64)
    if y.shape != y_hat.shape or y.ndim < 1 or y.shape[-1] < 1:
        raise ShapeError("measurement and prediction do not fit", found=y_hat.shape, needed=y.shape)
    if not (np.all(np.isfinite(y)) and np.all(np.isfinite(y_hat))):
        raise DataError("a measurement or prediction holds samples that are not finite")
    return y, y_hat


def _rms(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(np.mean(values**2, axis=-1)))


def _require_power(scale: NDArray[np.float64], problem: str) -> None:
    if np.any(scale == 0):
        raise DataError(problem, needed="a signal that changes", action="choose another record")
