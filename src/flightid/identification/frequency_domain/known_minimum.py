"""Minima that are known, by which a search from elsewhere is known to come to the same."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.multistart import DenseEnd

Array = NDArray[np.float64]
NEAR = 0.5
"""Standard errors within which a search counts as at a minimum: its last steps lead there."""
TOLD = 1e-5
"""Diagonal of a triangle of columns of unit length below which data leave a combination open."""


@dataclass(frozen=True)
class KnownMinimum:
    """A minimum of a sum of squares, with the ellipsoid about it in which a search counts as there.

    Attributes
    ----------
    end : DenseEnd
    limit : float
        Squared length of the residuals' move within the ellipsoid.

    Example
    -------
    >>> end = DenseEnd(np.zeros(1), 4.0, 3, "cost", np.array([2.0, 0.0]), np.array([[0.0], [1.0]]))
    >>> minimum = KnownMinimum.of(end)
    >>> minimum.holds(np.array([0.9])), minimum.holds(np.array([1.1]))
    (True, False)
    """

    end: DenseEnd
    limit: float

    @classmethod
    def of(cls, end: DenseEnd) -> KnownMinimum | None:
        """Where a search ended; None at no minimum, or where data leave combinations open."""
        n_residuals, n = end.jacobian.shape
        if not end.is_converged or n_residuals <= n:
            return None
        products = end.jacobian.T @ end.jacobian
        lengths = np.sqrt(np.diagonal(products))
        if np.min(lengths) == 0.0:
            return None
        try:
            triangle = np.linalg.cholesky(products / np.outer(lengths, lengths))
        except np.linalg.LinAlgError:
            return None
        if np.min(np.diagonal(triangle)) < TOLD:
            return None
        variance = float(end.residuals @ end.residuals) / (n_residuals - n)
        return cls(end, NEAR**2 * variance)

    @classmethod
    def all_of(cls, ends: Iterable[DenseEnd]) -> list[KnownMinimum]:
        """Those among where searches ended."""
        return [each for end in ends if (each := cls.of(end)) is not None]

    def holds(self, x: Array) -> bool:
        """Whether values lie within half a standard error of the minimum."""
        moved = self.end.jacobian @ (x - self.end.x)
        return bool(moved @ moved <= self.limit)
