"""Products of the rows of a block Hankel matrix with each other, from those of one lag.

Rows i + 1 and j + 1 hold what rows i and j do but for a sample at either end, so their product is
the former one shifted: lags are summed once over the record, not once for each row.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SPAN = 1 << 14
"""Samples whose lags are summed while they are in the cache."""
FADED = 1e-4
"""Share of a signal's largest square over a row that smaller ones hold: shifted sums keep the rest
of their digits."""


def hankel_products(joint: Array, blocks: int, *, levels: bool) -> Array | None:
    """H Hᵀ of signals (k, n_samples), shape (blocks · k, blocks · k), time by time.

    None where a signal fades over the blocks, so that differences of sums lose digits.

    Parameters
    ----------
    joint : ndarray, shape (k, n_samples)
    blocks : int
    levels : bool
        Whether the mean of each row of H comes off.

    Example
    -------
    >>> hankel_products(np.array([[1.0, 2.0, 3.0]]), 2, levels=False)
    array([[ 5.,  8.],
           [ 8., 13.]])
    """
    k, columns = len(joint), joint.shape[1] - blocks + 1
    found = np.zeros((blocks, k, blocks, k))
    found[0] = _of_lags(joint, blocks, columns).transpose(0, 2, 1)
    before, after = joint[:, : blocks - 1], joint[:, columns:]
    for row in range(1, blocks):
        moved = blocks - row
        gone = before[:, row - 1, None, None] * before[:, row - 1 :].T[None]
        come = after[:, row - 1, None, None] * after[:, row - 1 :].T[None]
        found[row, :, row:] = found[row - 1, :, row - 1 : -1] + (come - gone)[:, :moved]
    squares = np.einsum("ikik->ik", found)
    if not np.all(squares >= FADED * np.max(squares, axis=0)):
        return None
    flat = found.reshape(blocks * k, blocks * k)
    upper = np.triu(flat)
    whole = upper + np.triu(flat, 1).T
    if levels:
        sums = np.cumsum(
            np.concatenate([joint[:, :columns].sum(axis=1)[None], (after - before).T]), axis=0
        )
        whole -= np.outer(sums, sums) / columns
    return np.asarray(whole)


def _of_lags(joint: Array, blocks: int, columns: int) -> Array:
    """Σ a(t) b(t + lag) over the columns, (k, k, blocks)."""
    k = len(joint)
    found = np.zeros((k, k, blocks))
    for first in range(0, columns, SPAN):
        last = min(first + SPAN, columns)
        for one in range(k):
            for other in range(k):
                later = joint[other, first : last + blocks - 1]
                found[one, other] += np.correlate(later, joint[one, first:last], "valid")
    return found
