"""The triangle of least squares with many rows."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ROWS, COLUMNS = 256, 4
"""Rows of a block that stays in the cache, at least so many for each column."""
AT_ONCE = 256
"""Blocks that are copied together."""


def triangle_of_rows(columns: Array) -> Array:
    """R of columns = QR, by blocks of rows; its rows have the signs that blocks give them.

    Parameters
    ----------
    columns : ndarray, shape (n, k)

    Returns
    -------
    ndarray, shape (min(n, k), k)

    Reference
    ---------
    Demmel, Grigori, Hoemmen & Langou (2012), Communication-optimal parallel and sequential QR and
    LU factorizations, *SIAM J. Scientific Computing* 34(1), section 3.

    Example
    -------
    >>> np.abs(triangle_of_rows(np.array([[3.0], [4.0]])))
    array([[5.]])
    """
    n, k = columns.shape
    rows = max(ROWS, COLUMNS * k)
    if n < 2 * rows or not k:
        return np.asarray(np.linalg.qr(columns, mode="r"))
    blocks = columns[: n // rows * rows].reshape(-1, rows, k)
    parts = [
        np.asarray(np.linalg.qr(blocks[first : first + AT_ONCE], mode="r")).reshape(-1, k)
        for first in range(0, len(blocks), AT_ONCE)
    ]
    return triangle_of_rows(np.concatenate([*parts, columns[len(blocks) * rows :]]))


def triangle_of_parts(parts: Iterable[Array]) -> Array:
    """The same of rows that come part by part, so that long columns need not stand anywhere.

    Parameters
    ----------
    parts : iterable of ndarray, each shape (n, k)

    Example
    -------
    >>> np.abs(triangle_of_parts([np.array([[3.0]]), np.array([[4.0]])]))
    array([[5.]])
    """
    return triangle_of_rows(np.concatenate([triangle_of_rows(part) for part in parts]))
