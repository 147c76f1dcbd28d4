"""Inputs of a record at neighbouring lags, zero before it, means taken out.

Their columns repeat each other, one sample on, so that products with them are sums over the inputs
themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.lagged_products import at_lags, lagged_products

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LaggedInputs:
    """Columns U of one record, lags of the first input first.

    Attributes
    ----------
    centred : ndarray, shape (n_inputs, n)
        Means taken out.
    n_lags : int
        Lags 0 to ``n_lags - 1``.
    formed : bool
        The columns are asked for by themselves: products are then theirs.

    Example
    -------
    >>> lagged = LaggedInputs(np.array([[1.0, -2.0, 1.0]]), 2)
    >>> lagged.columns.T
    array([[ 1.        , -2.        ,  1.        ],
           [ 0.33333333,  1.33333333, -1.66666667]])
    """

    centred: Array
    n_lags: int
    formed: bool = False

    @cached_property
    def columns(self) -> Array:
        """U, shape (n, n_inputs · n_lags)."""
        count, n = self.centred.shape
        rows = np.zeros((count, self.n_lags, n))
        for lag in range(self.n_lags):
            rows[:, lag, lag:] = self.centred[:, : n - lag]
        rows -= rows.mean(axis=2, keepdims=True)
        return np.asarray(rows.reshape(-1, n).T)

    @cached_property
    def squares(self) -> Array:
        """UᵀU."""
        if self.formed:
            return np.asarray(self.columns.T @ self.columns)
        longest, size = self.n_lags - 1, len(self._totals)
        found = lagged_products([self._padded], longest, longest)
        found = found.transpose(1, 0, 3, 2).reshape(size, size)
        return np.asarray(found - np.outer(self._totals, self._totals) / self.centred.shape[1])

    def products(self, parts: Sequence[Array]) -> list[Array]:
        """XᵀU for each of some columns X (n, k)."""
        if self.formed:
            return [np.asarray(columns.T @ self.columns) for columns in parts]
        n = self.centred.shape[1]
        return [
            found[:, :-1] - np.outer(found[:, -1] / n, self._totals)
            for found in self._with_lags(parts)
        ]

    @cached_property
    def _totals(self) -> Array:
        """Sums of inputs at their lags, before means are taken out."""
        last = self.centred[:, ::-1][:, : self.n_lags - 1]
        dropped = np.concatenate([np.zeros((len(last), 1)), np.cumsum(last, axis=1)], axis=1)
        return np.asarray((self.centred.sum(axis=1)[:, None] - dropped).ravel())

    @cached_property
    def _padded(self) -> Array:
        return np.concatenate([np.zeros((len(self.centred), self.n_lags - 1)), self.centred], 1)

    def _with_lags(self, parts: Sequence[Array]) -> list[Array]:
        """Products of columns with inputs at their lags and, last, with a constant one."""
        count, n = self.centred.shape
        found = [np.zeros((self.n_lags * count + 1, columns.shape[1])) for columns in parts]
        for piece, lags in at_lags(self._padded, n, self.n_lags - 1, beside=1.0):
            for each, columns in zip(found, parts, strict=True):
                np.add(each, lags @ columns[piece], out=each)
        by_lag = [each[:-1].reshape(self.n_lags, count, -1).transpose(2, 1, 0) for each in found]
        return [
            np.concatenate([lags.reshape(len(lags), -1), each[-1:].T], axis=1)
            for lags, each in zip(by_lag, found, strict=True)
        ]
