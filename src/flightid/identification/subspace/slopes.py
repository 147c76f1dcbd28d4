"""Slopes of a predictor's errors along directions of its entries, or their products alone.

A search needs the triangle of slopes and errors: of a long record their products fit into the
cache, where the slopes themselves are a hundred megabytes that are written and read again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass
from flightid.identification.records.nuisance import Nuisance
from flightid.uncertainty.triangle import LEAST_DIAGONAL, SIZES

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array, Array]
LEFT = 1e-4
"""Share of a slope's square that a record's own numbers must leave, for four digits to be lost."""


@dataclass(frozen=True, eq=False)
class SlopeDrives:
    """De = -C (q - A + K C)⁻¹ (dA x + dB u + dK e - K dC x - K dD u) - dC x - dD u, whitened.

    Attributes
    ----------
    matrices : tuple of ndarray
        A, B, C, D, K.
    whiten : ndarray, shape (p, p)
    forced, direct : ndarray, shapes (n_basis, n, n + p + m) and (n_basis, p, n + p + m)
        What states, errors and inputs push, and show at once, along each direction.
    """

    matrices: Matrices
    whiten: Array
    forced: Array
    direct: Array

    @classmethod
    def of(
        cls,
        matrices: Matrices,
        whiten: Array,
        basis: Array,
        shapes: Sequence[tuple[int, int]],
    ) -> SlopeDrives:
        """Along columns of a basis of the entries of A, B, C, (D,) K, whose shapes these are."""
        _, b, c, _, k = matrices
        by = np.split(basis, np.cumsum([r * w for r, w in shapes])[:-1])
        slopes = [
            np.moveaxis(each.reshape(*s, -1), 2, 0) for each, s in zip(by, shapes, strict=True)
        ]
        da, db, dc, dk = *slopes[:3], slopes[-1]
        dd = slopes[3] if len(slopes) > 4 else np.zeros((len(dc), len(c), b.shape[1]))
        forced = np.concatenate([da - k @ dc, dk, db - k @ dd], axis=2)
        shown = -np.concatenate([dc, np.zeros((len(dc), len(c), len(c))), dd], axis=2)
        return cls(matrices, whiten, forced, whiten @ shown)

    def columns(self, state: Array, error: Array, u: Array) -> Array:
        """All of them over a record, (p · n_samples, n_basis), output after output."""
        a, _, c, _, k = self.matrices
        driving = np.concatenate([state, error, u])
        made = _native.slope_recursion(
            a - k @ c, self.whiten @ c, self.forced, self.direct, driving
        )
        return made.swapaxes(0, 1).reshape(error.size, -1)

    def products(self, signals: Array, start: Array, left: Array, own: Nuisance) -> Array:
        """Products with each other of slopes, of errors and of a record's own directions.

        Parameters
        ----------
        signals : ndarray, shape (m + p, n_samples)
            Inputs, and outputs about their levels.
        start : ndarray, shape (n,)
            First state.
        left : ndarray, shape (p, n_samples)
            Whitened errors without what the record's own numbers explain.
        own : Nuisance
            These numbers: directions over the first samples of each output.
        """
        a, b, c, d, k = self.matrices
        run = a - k @ c, c, np.hstack([b - k @ d, k]), np.hstack([-d, np.eye(len(c))]), start
        n_rows, n_own = own.space.shape
        rows = np.ascontiguousarray(own.space.T).reshape(n_own, len(c), n_rows // len(c))
        slopes = self.whiten @ c, self.forced, self.direct
        return _native.slope_products(run, slopes, signals, left, rows)


def triangle_of_products(records: Sequence[Array], count: int) -> Array | None:
    """Triangle of `count` slopes and errors, a column of it a row; None where it lost digits.

    Parameters
    ----------
    records : sequence of ndarray
        `SlopeDrives.products` of each record; own directions, the last, are eliminated.
    count : int

    Example
    -------
    >>> triangle_of_products([np.array([[4.0, 2.0], [2.0, 5.0]])], 1)
    array([[2., 0.],
           [1., 0.]])
    """
    kept = slice(count + 1)
    whole = np.sum([np.diag(each)[:count] for each in records], axis=0)
    left = np.sum(
        [each[kept, kept] - each[kept, count + 1 :] @ each[count + 1 :, kept] for each in records],
        axis=0,
    )
    squares = np.diag(left)[:count]
    with np.errstate(invalid="ignore"):
        length = np.sqrt(squares)
    if not np.all((length > SIZES[0]) & (length < SIZES[1]) & (squares > LEFT * whole)):
        return None
    try:
        lower = np.linalg.cholesky(left[:count, :count] / np.outer(length, length))
    except np.linalg.LinAlgError:
        return None
    if not np.min(np.diag(lower), initial=1.0) >= LEAST_DIAGONAL:
        return None
    found = np.zeros((count + 1, count + 1))
    found[:count, :count] = lower * length[:, None]
    found[count, :count] = np.linalg.solve(lower, left[:count, count] / length)
    return found
