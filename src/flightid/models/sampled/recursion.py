"""The recursion x(t+1) = A x(t) + w(t) for many forcings (native: `linear_recursion.rs`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid import _native

Array = NDArray[np.float64]


def spectral_radius(a: Array) -> float:
    """Largest absolute eigenvalue, zero for an empty matrix."""
    return float(np.max(np.abs(np.linalg.eigvals(a)), initial=0.0))


def run_recursion(a: Array, forcing: Array, initial: Array | None = None) -> Array:
    """States of x(t+1) = A x(t) + w(t) from x(0).

    Parameters
    ----------
    a : ndarray, shape (n, n)
    forcing : ndarray, shape (n, n_samples) or (k, n, n_samples)
        w, for one or k forcings.
    initial : ndarray, shape (n,) or (k, n), optional
        x(0); default: rest.

    Returns
    -------
    ndarray, shape of `forcing`

    Example
    -------
    >>> run_recursion(np.array([[0.5]]), np.zeros((1, 4)), np.array([8.0]))
    array([[8., 4., 2., 1.]])
    """
    *_, n, n_samples = forcing.shape
    rows = np.asarray(forcing, dtype=np.float64).reshape(-1, n, n_samples).swapaxes(1, 2)
    first = np.zeros(forcing.shape[:-1]) if initial is None else initial
    starts = np.broadcast_to(first, forcing.shape[:-1]).reshape(-1, n)
    matrix, forced, begun = (np.ascontiguousarray(each, float) for each in (a, rows, starts))
    # One that runs away is wanted as far as it is finite.
    found = _native.linear_recursion(matrix, forced, begun, anyhow=True)
    return found.swapaxes(1, 2).reshape(forcing.shape)
