"""Forms in the covariance of an autoregression, by sending columns through its recursion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.recursive_filter import filtered_from

Array = NDArray[np.float64]
AT_ONCE = 1 << 14
"""Samples that are sent through a recursion together."""
DOUBLINGS = 60
"""Of the time that a recursion rings on."""
TOLD, LONGEST = 1e-9, 64
"""Share of a sum that may be missed, and how often a recursion is followed that far."""


def driven_products(columns: Array, denominator: Array) -> Array:
    """Products of columns by the covariance of a recursion that unit white noise drives.

    A form in it is the power of the columns sent through the recursion, what rings on behind their
    ends with them.

    Parameters
    ----------
    columns : ndarray, shape (n, k)
    denominator : ndarray, shape (order + 1,)
        Of the recursion, stable, with a leading one.

    Returns
    -------
    ndarray, shape (k, k)

    Reference
    ---------
    Brockwell & Davis, *Time Series: Theory and Methods*, 2nd ed., section 4.4.

    Example
    -------
    >>> driven_products(np.ones((1, 1)), np.array([1.0, -0.5])).round(6)
    array([[1.333333]])
    """
    count, order = columns.shape[1], denominator.size - 1
    state, found = np.zeros((count, order)), np.zeros((count, count))
    for begin in range(0, len(columns), AT_ONCE):
        rows = np.ascontiguousarray(columns[begin : begin + AT_ONCE].T)
        made, state = filtered_from([1.0], denominator, rows, state)
        found += made @ made.T
    ringing = _ringing(denominator)
    if ringing is not None:
        return np.asarray(found + state @ ringing @ state.T)
    silent = np.zeros((count, AT_ONCE))
    for _ in range(LONGEST):
        made, state = filtered_from([1.0], denominator, silent, state)
        rest = made @ made.T
        found += rest
        if np.trace(rest) <= TOLD * np.trace(found):
            break
    return found


def _ringing(denominator: Array) -> Array | None:
    """Power that each state of a recursion's filter sends out without an input, by doubling.

    None where squares of its matrix lose their digits: poles close together and near the circle.
    """
    turn = np.eye(denominator.size - 1, k=1)
    turn[:, 0] -= denominator[1:]
    first, once = np.zeros_like(turn), turn
    first[0, 0] = 1.0
    found = first
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(DOUBLINGS):
            found = found + turn.T @ found @ turn
            turn = turn @ turn
            if np.max(np.abs(turn)) < np.finfo(float).eps ** 2:
                break
        missed = found - first - once.T @ found @ once
        sound = np.max(np.abs(missed)) <= TOLD * np.max(np.abs(found))
    return found if sound else None
