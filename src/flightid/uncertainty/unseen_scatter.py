"""What records that agree cannot exclude: flights that differ by a few percent look alike, too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.parts import LEAST_INFORMATION, RecordParts, seen_by_all, told_alone

Array = NDArray[np.float64]
FLOWN_APART = 0.03
"""Relative deviation of coefficients from flight to flight that records have to exclude: what
repeated flights of one vehicle at one condition were measured to scatter by."""
MOST_TERMS = 400
"""Of the series of a distribution, which falls faster than any power beyond half the square."""
NO_MORE = 1e-9
"""Largest share that the rest of the series may add."""


@dataclass(frozen=True)
class UnseenScatter:
    """How well these records agree if flights scatter, and what that would do to bars.

    Attributes
    ----------
    n_records : int
    chance : float
        That flights apart by `FLOWN_APART` in each coefficient agree as well as these.
    longer : float
        Largest ratio of the bars that such flights would need to those that stand.
    """

    n_records: int
    chance: float
    longer: float


@dataclass(frozen=True, eq=False)
class ComparedRecords:
    """Records beside each other: by how much they differ, and by how much they could be seen to.

    Attributes
    ----------
    square : float
        Sum of squares of what records differ by, in standard deviations of noise.
    slopes : ndarray, shape (d, n_records, p)
        How these d differences move with the parameters of each record.
    weights : ndarray, shape (n_records, p, p)
        How the common estimates move with them.
    alone : ndarray of bool, shape (p,)
        Estimates that one record tells: nothing is claimed of other flights.
    """

    square: float
    slopes: Array
    weights: Array
    alone: NDArray[np.bool_]

    def of(self, count: int) -> ComparedRecords:
        """The same of the first parameters alone; the others are each record's own."""
        return ComparedRecords(
            self.square,
            self.slopes[:, :, :count],
            self.weights[:, :count, :count],
            self.alone[:count],
        )

    def unseen(self, moves: Array, stderr: Array, apart: float = FLOWN_APART) -> UnseenScatter:
        """What flights that are so far apart would look like.

        Parameters
        ----------
        moves : ndarray, shape (p, k)
            How the estimates go with each of k properties that scatter by themselves, for a whole
            of it: coefficients of their own on the diagonal.
        stderr : ndarray, shape (p,)
            Standard errors of the estimates, as they stand.
        apart : float
            Standard deviation of each property from flight to flight, over its value.

        Assumes
        -------
        Properties that scatter normally; a level of the noise that is known.

        Example
        -------
        >>> # Two records of equal weight, standard errors of 1 each, apart by half of one.
        >>> pair = ComparedRecords(0.5**2 / 2, np.array([[[1.0], [-1.0]]]) / np.sqrt(2.0),
        ...                        np.full((2, 1, 1), 0.5), np.array([False]))
        >>> hidden = pair.unseen(np.array([[100.0]]), np.array([np.sqrt(0.5)]))
        >>> round(hidden.chance, 3), round(hidden.longer, 3)  # P(χ²₁ < 0.125 / 10), √10
        (0.089, 3.162)
        """
        size = apart * moves
        d, count = self.slopes.shape[:2]
        moved = (self.slopes @ size).reshape(d, -1)
        scales = np.ones(d)
        found = np.linalg.svd(moved, compute_uv=False)
        scales[: found.size] += found**2
        added = np.sum((self.weights @ size) ** 2, axis=(0, 2))
        asked = (stderr > 0.0) & ~self.alone
        ratio = np.sqrt(1.0 + added[asked] / stderr[asked] ** 2)
        return UnseenScatter(
            count, chance_below(self.square, scales), float(np.max(ratio, initial=1.0))
        )


def compared_records(
    parts: Sequence[RecordParts], solve: Array, spread: Array
) -> ComparedRecords | None:
    """Records side by side, by what each sees about as well as any other.

    Parameters
    ----------
    parts : sequence of RecordParts
        Each as one part.
    solve : ndarray, shape (p, p)
        What turns scores into changes of the estimates.
    spread : ndarray, shape (p, p)
        Covariance of the estimates by the noise alone, for scales.

    Returns
    -------
    ComparedRecords or None
        None where nothing is seen by two.
    """
    seen = seen_by_all(parts)
    known = [each for each in seen if each is not None]
    if not known or len(known) < len(seen):
        return None
    score = np.concatenate([each for each, _, _ in known])
    common = np.vstack([slope for _, slope, _ in known])
    # What is common to all records is the estimate's; the rest tells them apart.
    left, sizes, _ = np.linalg.svd(common, full_matrices=True)
    rank = int(np.count_nonzero(sizes**2 > LEAST_INFORMATION * np.max(sizes, initial=0.0) ** 2))
    apart = left[:, rank:].T
    if not len(apart):
        return None
    own, first = [], 0
    for each, _, slope in known:
        own.append(apart[:, first : first + len(each)] @ slope)
        first += len(each)
    weights = np.array([solve @ part.information[0] for part in parts])
    return ComparedRecords(
        float(np.sum((apart @ score) ** 2)),
        np.stack(own, axis=1),
        weights,
        told_alone(parts, solve, spread),
    )


def chance_below(square: float, scales: Array) -> float:
    """Probability that a sum of squares of normal numbers of these variances is smaller.

    Parameters
    ----------
    square : float
    scales : ndarray, shape (d,)
        Variances, positive.

    Reference
    ---------
    Ruben (1962), Probability content of regions under spherical normal distributions IV, *Annals of
    Mathematical Statistics* 33(2): a mixture of χ² distributions.

    Example
    -------
    >>> round(chance_below(5.991465, np.ones(2)), 6), round(chance_below(2.0, np.full(2, 4.0)), 6)
    (0.95, 0.221199)
    """
    least, d = float(np.min(scales)), len(scales)
    rest = 1.0 - least / scales
    weights = [float(np.prod(np.sqrt(least / scales)))]
    total = weights[0] * float(scipy.special.chdtr(d, square / least))
    powers = [0.5 * float(np.sum(rest**k)) for k in range(1, MOST_TERMS + 1)]
    for k in range(1, MOST_TERMS + 1):
        weights.append(float(np.dot(powers[:k], weights[::-1])) / k)
        share = float(scipy.special.chdtr(d + 2 * k, square / least))
        total += weights[-1] * share
        if share < NO_MORE:  # Weights add up to one.
            break
    return min(total, 1.0)
