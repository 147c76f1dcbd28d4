"""Shapes that a spread between vehicles may have, as numbers that a search is free to move."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from flightid.errors import OptionError
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.frozen import dataclass

Array = NDArray[np.float64]
STRUCTURES = ("diagonal", "factor", "full")
PER_FULL, BEYOND_FACTOR = 3, 2
"""Vehicles a parameter that a full matrix takes, and vehicles beyond the parameters that one common
factor takes; with fewer the spread is a diagonal."""
NARROW = 3
"""Parameters up to which a factor is no simpler than a full matrix."""
FEWEST_REPEATS = 3.0
"""Repeats that tell a parameter, below which flights of a vehicle have no spread of their own."""


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
            return np.asarray((2.0 * slope @ self._lower(numbers))[_lower_places(self.p)])
        own = 2.0 * np.diag(slope) * numbers[: self.p]
        if self.kind == "diagonal":
            return np.asarray(own)
        return np.concatenate([own, 2.0 * slope @ numbers[self.p :]])

    def start(self, deviations: Array) -> Array:
        """Free numbers of independent spreads with these standard deviations."""
        if self.kind == "full":
            return np.asarray(np.diag(deviations)[_lower_places(self.p)])
        if self.kind == "diagonal":
            return deviations.copy()
        # A factor of zero would be a saddle, which no step along its slope leaves.
        return np.concatenate([0.9 * deviations, 0.4 * deviations])

    def _lower(self, numbers: Array) -> Array:
        lower = np.zeros((self.p, self.p))
        lower[_lower_places(self.p)] = numbers
        return lower


@dataclass(frozen=True)
class SpreadOfSome:
    """A spread of some of p parameters; the others have none.

    Attributes
    ----------
    of_those : SpreadStructure
    places : tuple of int
        Which parameters they are.
    p : int
        All parameters.

    Example
    -------
    >>> SpreadOfSome(SpreadStructure("diagonal", 1), (1,), 2).matrix(np.array([3.0])).tolist()
    [[0.0, 0.0], [0.0, 9.0]]
    """

    of_those: SpreadStructure
    places: tuple[int, ...]
    p: int

    def matrix(self, numbers: Array) -> Array:
        """Covariance of all, shape (p, p)."""
        made = np.zeros((self.p, self.p))
        made[np.ix_(self.places, self.places)] = self.of_those.matrix(numbers)
        return made

    def gradient(self, numbers: Array, slope: Array) -> Array:
        """Slope along the free numbers from the symmetric one of all, shape (size,)."""
        return self.of_those.gradient(numbers, slope[np.ix_(self.places, self.places)])

    def start(self, deviations: Array) -> Array:
        """Free numbers of independent spreads with these standard deviations of all."""
        return self.of_those.start(deviations[list(self.places)])


def flights_spread(data: FlightEstimates) -> SpreadOfSome | None:
    """The richest spread between flights of one vehicle that its repeats support.

    Parameters
    ----------
    data : FlightEstimates

    Returns
    -------
    SpreadOfSome or None
        Of the parameters that are told by 3 repeats or more (`telling_repeats`); None: of none.
        Where one flight of each vehicle tells a parameter, nothing parts vehicles from flights:
        what is seen counts as spread between vehicles then, which is cautious of the next one.
    """
    repeats = telling_repeats(data)
    places = tuple(int(i) for i in np.flatnonzero(repeats >= FEWEST_REPEATS))
    if not places:
        return None
    kind = supported(len(places), int(min(repeats[list(places)])))
    return SpreadOfSome(SpreadStructure(kind, len(places)), places, len(repeats))


def telling_repeats(data: FlightEstimates) -> Array:
    """Flights beyond the first of each vehicle, as many of equal information tell as much.

        Σ_i (Σ_j u_ij)² / Σ_j u_ij² − 1,   u_ij = 1 / (s_ij² + t²)

    t² is the spread of the vehicles' best flights, s² the variance of an estimate.

    Parameters
    ----------
    data : FlightEstimates

    Returns
    -------
    ndarray, shape (p,)

    Reference
    ---------
    Kish, *Survey Sampling* (1965), section 11.7 (effective number of unequal weights).

    Example
    -------
    >>> data = FlightEstimates.of(["a"], [*"aabb"], [[1.0], [1.2], [2.0], [9.0]],
    ...                           np.array([0.01, 0.01, 0.01, 90.0]).reshape(4, 1, 1))
    >>> telling_repeats(data).round(2).tolist()
    [1.01]
    """
    found = np.zeros(len(data.names))
    for i in range(len(data.names)):
        rows = np.flatnonzero(data.known[:, i])
        variances, member = data.covariances[rows, i, i], data.member_of[rows]
        order = np.lexsort((variances, member))
        best = order[np.flatnonzero(np.diff(member[order], prepend=-1))]
        errors = variances[best].mean()
        apart = float(np.var(data.values[rows[best], i], ddof=1)) if len(best) > 1 else 0.0
        told = 1.0 / (variances + max(apart - errors, 0.0))
        sums, squares = (np.bincount(member, told**power) for power in (1, 2))
        there = squares > 0.0
        found[i] = np.sum(sums[there] ** 2 / squares[there] - 1.0)
    return found


@cache
def _lower_places(p: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Places of a lower triangle: searches ask for them thousands of times."""
    return np.tril_indices(p)
