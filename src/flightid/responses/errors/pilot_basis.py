"""Orthonormal bases of what a pilot's coefficients move, transients eliminated record by record."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
LEAST = 1e-8
"""Singular value, of columns of unit length, below which coefficients move nothing together.

Slopes are rounded at 1e-16 of their size: what is kept is told to eight digits.
"""


@dataclass(frozen=True)
class PilotBasis:
    """Factors that make weighed slopes orthonormal, those of transients in their record alone.

    Slopes of a record are rows, shape (n_acting, 2 n_f). Coefficients that only move the bins
    together with others, as a pole beside a zero does, have no direction of their own.

    Attributes
    ----------
    ending : slice
        Place of the transient among the slopes of a record.
    rows : sequence of ndarray
        The slopes.
    own : list of ndarray, each shape (n_own, k)
        Transients times this are orthonormal.
    shared : ndarray, shape (n_shared, m)
    crossed : list of ndarray, each shape (k, m)
        Others times `shared`, less the orthonormal transients times this, are orthonormal.

    Example
    -------
    >>> rows = [np.array([[1.0, 2.0, 1.0], [1.0, 1.0, 1.0]])]  # a slope, then a constant
    >>> basis = PilotBasis.of(rows, slice(1, 2))
    >>> own, others = basis.components([np.array([5.0, 5.0, 5.0])])
    >>> round(float(own[0] @ own[0] + others @ others), 9)
    75.0
    """

    ending: slice
    rows: Sequence[Real]
    own: list[Real]
    shared: Real
    crossed: list[Real]

    @classmethod
    def of(cls, rows: Sequence[Real], ending: slice) -> PilotBasis:
        """Of weighed slopes, record by record."""
        squares = [np.einsum("ib,ib->i", each, each) for each in rows]
        common = _lengths(_others(np.sum(squares, axis=0), ending))
        own, left, beside = [], [], []
        for each, square in zip(rows, squares, strict=True):
            lengths = _lengths(square[ending])
            scaled = [each[ending] / lengths[:, None], _others(each, ending) / common[:, None]]
            triangle = _triangle(np.concatenate(scaled).T)
            first = min(len(lengths), len(triangle))
            turned, sizes, axes = np.linalg.svd(triangle[:first, : len(lengths)])
            kept = sizes > LEAST
            own.append((axes[: len(sizes)][kept] / sizes[kept, None]).T / lengths[:, None])
            above = turned.T @ triangle[:first, len(lengths) :]
            beside.append(above[kept])
            left += [above[~kept], triangle[first:, len(lengths) :]]
        triangle = _triangle(np.concatenate(left))
        _, sizes, axes = np.linalg.svd(triangle)
        kept = sizes > LEAST
        factor = (axes[: len(sizes)][kept] / sizes[kept, None]).T
        crossed = [each @ factor for each in beside]
        return cls(ending, rows, own, factor / common[:, None], crossed)

    def components(self, values: Sequence[Real]) -> tuple[list[Real], Real]:
        """Of values of each record, shape (2 n_f,): along its own directions, along shared ones."""
        own: list[Real] = []
        shared: Real = np.zeros(self.shared.shape[1:])
        for rows, factor, crossed, value in zip(
            self.rows, self.own, self.crossed, values, strict=True
        ):
            products = rows @ value
            own.append(factor.T @ products[self.ending])
            shared = shared + self.shared.T @ _others(products, self.ending) - crossed.T @ own[-1]
        return own, shared

    def taken(self) -> list[Real]:
        """Squared length of each value's unit vector within the basis, each shape (2 n_f,)."""
        found = []
        for rows, factor, crossed in zip(self.rows, self.own, self.crossed, strict=True):
            own = factor.T @ rows[self.ending]
            shared = self.shared.T @ _others(rows, self.ending) - crossed.T @ own
            found.append(np.einsum("ib,ib->b", own, own) + np.einsum("ib,ib->b", shared, shared))
        return found

    def covariance(self) -> Real:
        """Of the coefficients in unit noise: numerators, all transients, denominator.

        What no direction moves has no variance.
        """
        n_own, n_shared = self.ending.stop - self.ending.start, len(self.shared)
        n_records, first = len(self.rows), self.ending.start
        factor = np.empty((n_shared + n_records * n_own, self.shared.shape[1]))
        ends = slice(first, first + n_records * n_own)
        factor[:first], factor[ends.stop :] = self.shared[:first], self.shared[first:]
        pairs = list(zip(self.own, self.crossed, strict=True))
        factor[ends] = np.concatenate([-own @ crossed for own, crossed in pairs])
        found = factor @ factor.T
        for place, own in enumerate(self.own):
            at = slice(first + place * n_own, first + (place + 1) * n_own)
            found[at, at] += own @ own.T
        return np.asarray(found)

    def step(self, moved: Sequence[Real], values: Sequence[Real]) -> tuple[list[Real], Real]:
        """Changes of transients and of the others that leave no component of some values.

        Parameters
        ----------
        moved : sequence of ndarray, each shape (n_acting, 2 n_f)
            What the coefficients move of the values, as rows.
        values : sequence of ndarray, each shape (2 n_f,)
        """
        left, right = self.components(values)
        whole: Real = np.zeros((len(right), len(self.shared)))
        borders, products = [], [mine @ rows.T for mine, rows in zip(self.rows, moved, strict=True)]
        owns = [mine.T @ each[self.ending] for mine, each in zip(self.own, products, strict=True)]
        inverses = _inverses([each[:, self.ending] for each in owns])
        for place, (own, inverse, part) in enumerate(zip(owns, inverses, left, strict=True)):
            mine = self.shared.T @ _others(products[place], self.ending)
            shared = mine - self.crossed[place].T @ own
            beside, alone = inverse @ _others(own.T, self.ending).T, inverse @ part
            whole += _others(shared.T, self.ending).T - shared[:, self.ending] @ beside
            right = right - shared[:, self.ending] @ alone
            borders.append((alone, beside))
        moves = np.linalg.lstsq(whole, right, rcond=LEAST)[0]
        return [alone - beside @ moves for alone, beside in borders], np.asarray(moves)


def weighed_parts(values: Sequence[Complex], weights: Real) -> list[Real]:
    """Values of each record's bins times weights, real and imaginary parts in turn."""
    ends = np.cumsum([each.shape[-1] for each in values])[:-1]
    parts = zip(values, np.split(weights, ends), strict=True)
    return [(each * weight).view(np.float64) for each, weight in parts]


def _inverses(parts: Sequence[Real]) -> list[Real]:
    """Pseudo-inverses, at once where all have one shape."""
    if len({each.shape for each in parts}) == 1:
        return list(np.asarray(np.linalg.pinv(np.stack(parts), rcond=LEAST)))
    return [np.asarray(np.linalg.pinv(each, rcond=LEAST)) for each in parts]


def _triangle(columns: Real) -> Real:
    return np.asarray(np.linalg.qr(columns, mode="r"))


def _others(rows: Real, ending: slice) -> Real:
    return np.concatenate([rows[: ending.start], rows[ending.stop :]])


def _lengths(squares: Real) -> Real:
    return np.maximum(np.sqrt(squares), np.finfo(float).tiny)
