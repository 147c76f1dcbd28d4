"""Directions along which a fit takes noise out of residuals, and sums over these span by span."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass

Array = NDArray[np.float64]
TURN, TERMS = 0.5, 12
"""Largest phase (rad) over half of a span of samples, and terms of its series: 5e-13 is left."""


@dataclass(frozen=True, eq=False)
class FittedDirections:
    """Orthonormal directions along which a fit takes noise out of one record's residuals.

    Attributes
    ----------
    own : ndarray, shape (n_outputs, n, n_own)
        Of numbers that belong to this record.
    shared : ndarray, shape (n_outputs, n, n_shared)
        Of parameters; orthonormal over all records together.
    """

    own: Array
    shared: Array


def lags_of_form(columns: Array, form: Array, n_lags: int) -> Array:
    """Sums over a record of q(t)ᵀ M q(t + k), for lags k from zero on.

    Parameters
    ----------
    columns : ndarray, shape (n, m)
        Rows q(t).
    form : ndarray, shape (m, m)
        M, symmetric.
    n_lags : int

    Returns
    -------
    ndarray, shape (n_lags,)

    Example
    -------
    >>> lags_of_form(np.array([[1.0], [2.0], [3.0]]), np.eye(1), 2)
    array([14.,  8.])
    """
    return _native.lags_of_form(columns, form, n_lags)


def slow_transforms(columns: Array, length: int, n_bins: int) -> NDArray[np.complex128]:
    """Transforms of columns, padded with zeros to `length`, at the first bins.

    Within a span of samples the phase of a slow bin turns little: moments of each span carry it.

    Parameters
    ----------
    columns : ndarray, shape (n, m)
    length : int
        Of the transform.
    n_bins : int
        Bins 0 to ``n_bins - 1``.

    Returns
    -------
    ndarray of complex, shape (n_bins, m)

    Example
    -------
    >>> rows = np.arange(6.0)[:, None]
    >>> bool(np.allclose(slow_transforms(rows, 16, 3)[:, 0], np.fft.rfft(rows[:, 0], 16)[:3]))
    True
    """
    n, m = columns.shape
    omega = 2.0 * np.pi * np.arange(n_bins) / length
    span = int(np.clip(2.0 * TURN / max(omega[-1], 1e-300), 1, n))
    whole = n // span * span
    place = np.arange(span) - 0.5 * (span - 1)
    powers = np.array([(place / span) ** k for k in range(TERMS if span > 1 else 1)])
    moments = powers @ columns[:whole].reshape(n // span, span, m)
    if whole < n:
        last = np.zeros((1, span, m))
        last[0, : n - whole] = columns[whole:]
        moments = np.concatenate([moments, powers @ last])
    middles = np.arange(len(moments)) * span + 0.5 * (span - 1)
    turns = np.outer(omega, middles)
    cosines, sines = np.cos(turns), np.sin(turns)
    found, series = np.zeros((n_bins, m), complex), np.ones(n_bins, complex)
    for k, rows in enumerate(np.ascontiguousarray(moments.transpose(1, 0, 2))):
        found += series[:, None] * (cosines @ rows - 1j * (sines @ rows))
        series = series * (-1j * omega * span) / (k + 1)
    return found
