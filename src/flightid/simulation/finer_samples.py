"""Uniform samples on a finer grid, by the interpolating spline without knots of its own."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
DEGREE = 5
LONG = 20_000
"""Samples up to which splines are kept: they know nothing but the number of samples, and take
six numbers a step."""


def finer_samples(values: Array, times: int) -> Array:
    """Rows of samples and what lies between them, `times` steps from each to the next.

    Parameters
    ----------
    values : ndarray, shape (m, n)
        Smooth.
    times : int

    Returns
    -------
    ndarray, shape (m, times (n − 1) + 1)

    Reference
    ---------
    de Boor, *A Practical Guide to Splines*, rev. ed., ch. IX, X and XIII: a quintic without knots
    at the second and third sample from either end, as SciPy's ``make_interp_spline`` makes it; up
    to five samples have one polynomial.

    Example
    -------
    >>> finer_samples(np.array([[0.0, 1.0, 4.0, 9.0]]), 2)[0].round(9).tolist()
    [0.0, 0.25, 1.0, 2.25, 4.0, 6.25, 9.0]
    """
    n = values.shape[1]
    if n <= DEGREE:
        return _by_polynomial(values, np.arange(times * (n - 1) + 1) / times)
    weights = _weights(values)
    first, parts = (_kept if n <= LONG else _of_samples)(n, times)
    found = np.zeros((len(values), times * (n - 1) + 1))
    for place, part in enumerate(parts):
        found += weights[:, first + place] * part
    return found


def _by_polynomial(values: Array, at: Array) -> Array:
    n = values.shape[1]
    middle = (n - 1) / 2.0
    there, here = (np.vander(x - middle, n, increasing=True) for x in (np.arange(n), at))
    return np.asarray(np.linalg.solve(there, values.T).T @ here.T)


def _weights(values: Array) -> Array:
    """Weights of the B-splines that go through the samples, shape (m, n)."""
    n = values.shape[1]
    first, parts = (_kept if n <= LONG else _of_samples)(n, 1)
    band = np.zeros((2 * DEGREE + 1, n))
    for place, part in enumerate(parts):
        column = first + place
        band[DEGREE + np.arange(n) - column, column] = part
    solved = scipy.linalg.solve_banded(
        (DEGREE, DEGREE), band, values.T, overwrite_ab=True, check_finite=False
    )
    return np.ascontiguousarray(solved.T)


def _of_samples(n: int, times: int) -> tuple[NDArray[np.intp], list[Array]]:
    """`_splines` of so many samples, at so many steps from each to the next."""
    inner = np.arange(DEGREE // 2 + 1, n - DEGREE // 2 - 1, dtype=np.float64)
    ends = np.ones(DEGREE + 1)
    knots = np.concatenate([0.0 * ends, inner, (n - 1.0) * ends])
    return _splines(np.arange(times * (n - 1) + 1) / times, knots)


_kept = lru_cache(4)(_of_samples)
"""Records of one campaign are of few lengths; what is kept is read alone."""


def _splines(at: Array, knots: Array) -> tuple[NDArray[np.intp], list[Array]]:
    """First of the B-splines that are not zero at some places, and the values of all six."""
    span = np.searchsorted(knots, at, side="right") - 1
    span = np.clip(span, DEGREE, len(knots) - DEGREE - 2)
    left = [at - knots[span - k] for k in range(DEGREE)]
    right = [knots[span + 1 + k] - at for k in range(DEGREE)]
    parts = [np.ones(len(at))]
    for degree in range(1, DEGREE + 1):
        kept, raised = np.zeros(len(at)), []
        for k, part in enumerate(parts):
            share = part / (right[k] + left[degree - 1 - k])
            raised.append(kept + right[k] * share)
            kept = left[degree - 1 - k] * share
        parts = [*raised, kept]
    return span - DEGREE, parts
