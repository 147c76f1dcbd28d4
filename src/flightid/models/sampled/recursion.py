"""The recursion x(t+1) = A x(t) + w(t) for many forcings (native: `linear_recursion.rs`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid import _native

Array = NDArray[np.float64]
SPENT = 1e-20
"""Largest entry of a transition's power that leaves nothing of a state."""


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


def spent_after(closed: Array, most: int) -> int:
    """Samples after which nothing is left of a state, to rounding; `most` where it goes on.

    Example
    -------
    >>> spent_after(np.array([[0.5]]), 1000), spent_after(np.array([[1.0]]), 1000)
    (128, 1000)
    """
    samples, power = 1, closed
    with np.errstate(over="ignore", invalid="ignore"):
        while samples < most and not np.abs(power).max(initial=0.0) < SPENT:
            samples, power = 2 * samples, power @ power
    return min(samples, most)
