"""Signals through digital filters, without the second that SciPy's signal package takes to load."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native

Array = NDArray[np.float64]


def filtered(b: ArrayLike, a: ArrayLike, x: ArrayLike, axis: int = -1) -> Array:
    """A signal through b(z)/a(z), from rest.

    Parameters
    ----------
    b, a : array_like, shapes (k,) and (m,)
        Ascending powers of 1/z; a[0] is not zero.
    x : array_like
        Any shape.
    axis : int
        Of the samples.

    Returns
    -------
    ndarray
        Shape of `x`.

    Reference
    ---------
    Oppenheim & Schafer, *Discrete-Time Signal Processing*, 3rd ed., §6.3.4: transposed direct form
    II, with poles sums and products in the order of ``scipy.signal.lfilter``.

    Example
    -------
    >>> filtered([1.0], [1.0, -0.5], [1.0, 0.0, 0.0])
    array([1.  , 0.5 , 0.25])
    """
    above, below = np.atleast_1d(np.asarray(b, float)), np.atleast_1d(np.asarray(a, float))
    signal = np.asarray(x, dtype=np.float64)
    if len(below) == 1:
        return _convolved(above / below[0], signal, axis)
    rows = np.moveaxis(signal, axis, -1)
    flat = np.ascontiguousarray(rows).reshape(math.prod(rows.shape[:-1]), rows.shape[-1])
    at_rest = np.zeros((len(flat), max(len(above), len(below)) - 1))
    made, _ = _native.filter_rows(*_of_one_length(above, below), flat, at_rest)
    return np.moveaxis(made.reshape(rows.shape), -1, axis)


def filtered_from(b: ArrayLike, a: ArrayLike, x: Array, state: Array) -> tuple[Array, Array]:
    """Rows through b(z)/a(z) from some states, and the states they leave.

    Parameters
    ----------
    b, a : array_like
        As for `filtered`.
    x : ndarray, shape (n,) or (n_rows, n)
    state : ndarray, shape (order,) or (n_rows, order)
        Of the transposed direct form II; order is one less than the longer of `b` and `a`.

    Returns
    -------
    ndarray, ndarray
        Shapes of `x` and of `state`.

    Example
    -------
    >>> filtered_from([1.0], [1.0, -0.5], np.zeros(2), np.array([0.5]))
    (array([0.5 , 0.25]), array([0.125]))
    """
    above, below = np.atleast_1d(np.asarray(b, float)), np.atleast_1d(np.asarray(a, float))
    rows, held = np.atleast_2d(np.asarray(x, float)), np.atleast_2d(np.asarray(state, float))
    made, left = _native.filter_rows(*_of_one_length(above, below), rows, held)
    return made.reshape(np.shape(x)), left.reshape(np.shape(state))


def state_after(a: ArrayLike, y: Array) -> Array:
    """State of 1/a(z) after some outputs without inputs.

    Parameters
    ----------
    a : array_like, shape (order + 1,)
    y : ndarray, shape (order,)
        Last outputs, the newest first.

    Example
    -------
    >>> state_after([1.0, -0.5], np.array([1.0]))
    array([0.5])
    """
    below = np.asarray(a, dtype=np.float64)
    below = below / below[0]
    order = len(below) - 1
    return np.array([-np.sum(below[m + 1 :] * y[: order - m]) for m in range(order)])


def _of_one_length(above: Array, below: Array) -> tuple[Array, Array]:
    """Both divided by a[0], the shorter one continued by zeros."""
    length = max(len(above), len(below))
    b, a = np.zeros(length), np.zeros(length)
    b[: len(above)], a[: len(below)] = above / below[0], below / below[0]
    return b, a


def _convolved(weights: Array, signal: Array, axis: int) -> Array:
    """Without poles: sums that do not depend on one another."""
    rows = np.moveaxis(signal, axis, -1)
    n, before = rows.shape[-1], len(weights) - 1
    found = np.empty(rows.shape)
    latest_last = np.ascontiguousarray(-weights[None, ::-1])
    none, padded = np.zeros((1, n)), np.zeros((1, before + n))
    for place in np.ndindex(rows.shape[:-1]):
        padded[0, before:] = rows[place]
        found[place] = _native.left_of_neighbours(none, padded, latest_last)[0]
    return np.moveaxis(found, -1, axis)
