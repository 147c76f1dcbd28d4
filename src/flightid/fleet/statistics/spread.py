"""Shapes that a spread between vehicles may have, as numbers that a search is free to move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import OptionError
from flightid.frozen import dataclass

Array = NDArray[np.float64]
STRUCTURES = ("diagonal", "factor", "full")
PER_FULL, BEYOND_FACTOR = 3, 2
"""Vehicles a parameter that a full matrix takes, and vehicles beyond the parameters that one common
factor takes; with fewer the spread is a diagonal."""
NARROW = 3
"""Parameters up to which a factor is no simpler than a full matrix."""


def supported(p: int, freedom: int) -> str:
    """The richest structure that as many degrees of freedom support.

    Example
    -------
    >>> supported(5, 4), supported(5, 9), supported(5, 30), supported(1, 3)
    ('diagonal', 'factor', 'full', 'diagonal')
    """
    if p == 1:
        return "diagonal"
    if freedom >= PER_FULL * p:
        return "full"
    return "factor" if p > NARROW and freedom >= p + BEYOND_FACTOR else "diagonal"


@dataclass(frozen=True)
class SpreadStructure:
    """A covariance T of p numbers written by free ones, positive semidefinite whatever these are.

    ``"diagonal"``: T = diag(d²); ``"factor"``: T = diag(d²) + f fᵀ; ``"full"``: T = L Lᵀ with a
    lower triangle L. A variance of zero is inside, so nothing stands at a bound.

    Raises
    ------
    OptionError
        No such structure.

    Example
    -------
    >>> SpreadStructure("factor", 2).matrix(np.array([1.0, 2.0, 3.0, 0.0])).tolist()
    [[10.0, 0.0], [0.0, 4.0]]
    """

    kind: str
    p: int

    def __post_init__(self) -> None:
        if self.kind not in STRUCTURES:
            raise OptionError(
                "no such structure of a spread", found=self.kind, needed=", ".join(STRUCTURES)
            )

    @property
    def size(self) -> int:
        """Free numbers."""
        return {"diagonal": self.p, "factor": 2 * self.p, "full": self.p * (self.p + 1) // 2}[
            self.kind
        ]

    def matrix(self, numbers: Array) -> Array:
        """T, shape (p, p)."""
        if self.kind == "full":
            lower = self._lower(numbers)
            return np.asarray(lower @ lower.T)
        own = np.diag(numbers[: self.p] ** 2)
        if self.kind == "diagonal":
            return own
        return np.asarray(own + np.outer(numbers[self.p :], numbers[self.p :]))

    def gradient(self, numbers: Array, slope: Array) -> Array:
        """Slope along the free numbers from the symmetric one along T, shape (size,)."""
        if self.kind == "full":
            return np.asarray((2.0 * slope @ self._lower(numbers))[np.tril_indices(self.p)])
        own = 2.0 * np.diag(slope) * numbers[: self.p]
        if self.kind == "diagonal":
            return np.asarray(own)
        return np.concatenate([own, 2.0 * slope @ numbers[self.p :]])

    def start(self, deviations: Array) -> Array:
        """Free numbers of independent spreads with these standard deviations."""
        if self.kind == "full":
            return np.asarray(np.diag(deviations)[np.tril_indices(self.p)])
        if self.kind == "diagonal":
            return deviations.copy()
        # A factor of zero would be a saddle, which no step along its slope leaves.
        return np.concatenate([0.9 * deviations, 0.4 * deviations])

    def _lower(self, numbers: Array) -> Array:
        lower = np.zeros((self.p, self.p))
        lower[np.tril_indices(self.p)] = numbers
        return lower
