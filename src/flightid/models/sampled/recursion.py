"""The recursion x(t+1) = A x(t) + w(t) for many forcings at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FORGOTTEN = 1e-18
"""A power of A smaller than this adds nothing in double precision."""

GROWN = 1e6
"""A larger power of A belongs to an unstable system, whose sums are not worth the doubling."""


def spectral_radius(a: Array) -> float:
    """Largest absolute eigenvalue, zero for an empty matrix."""
    return float(np.max(np.abs(np.linalg.eigvals(a)), initial=0.0))


def run_recursion(a: Array, forcing: Array, initial: Array | None = None) -> Array:
    """States of x(t+1) = A x(t) + w(t) from x(0).

    Stable systems are summed by doubling, x over 2s samples from x over s, which is one matrix
    product for each doubling and ends where A^s has decayed; unstable ones sample by sample.

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

    Reference
    ---------
    Hillis & Steele, "Data parallel algorithms", *Communications of the ACM* 29 (1986): prefix sums.

    Example
    -------
    >>> run_recursion(np.array([[0.5]]), np.zeros((1, 4)), np.array([8.0]))
    array([[8., 4., 2., 1.]])
    """
    state = np.zeros_like(forcing, dtype=np.float64)
    state[..., 1:] = forcing[..., :-1]
    state[..., 0] = 0.0 if initial is None else initial
    n_samples = forcing.shape[-1]
    power, span = np.array(a, dtype=np.float64), 1
    size = np.abs(power).max(initial=0.0)
    while span < n_samples and size > FORGOTTEN:
        if size > GROWN:
            return _sample_by_sample(a, forcing, state[..., 0])
        state[..., span:] += power @ state[..., :-span]
        power, span = power @ power, 2 * span
        size = np.abs(power).max(initial=0.0)
    return state


def _sample_by_sample(a: Array, forcing: Array, initial: Array) -> Array:
    state = np.empty_like(forcing, dtype=np.float64)
    state[..., 0] = initial
    for t in range(1, forcing.shape[-1]):
        state[..., t] = state[..., t - 1] @ a.T + forcing[..., t - 1]
    return state
