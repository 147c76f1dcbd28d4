"""How each vehicle's own step stands to the one that all are said to share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import LEVEL, half_width, normal_quantiles

Array = NDArray[np.float64]
Places = NDArray[np.intp]
APART = 12.0
"""By how much the weighted squares (Cochran's Q) must fall where some of the vehicles stayed at
zero, in units of what is left: of six that share one step about 3 % fall as much."""
SMALL = 30
"""Vehicles, above which half of them does not pass for all by the signs of what they share."""
MOST = 0.15
"""Share of vehicles that may stay where most changed together."""


@dataclass(frozen=True, eq=False)
class OwnSteps:
    """Own steps of vehicles at one date, in shares of their medians.

    Attributes
    ----------
    members : ndarray of int, shape (k,)
        Vehicles with flights on both sides of the date.
    sizes, variances : ndarray, shape (k,)
    shared : Estimate
        The step that all are said to share, in the same shares.
    """

    members: Places
    sizes: Array
    variances: Array
    shared: Estimate

    @property
    def some_stayed(self) -> bool:
        """Whether more than a few stayed, and the others' step is another than the shared one.

        Cochran's Q about one size is held beside that of two kinds, one of which has none: a spread
        that goes on between the two leaves much within the kinds, and parts nothing.
        """
        k, fewest = len(self.sizes), int(max(1.0, MOST * len(self.sizes))) + 1
        if not fewest < k <= SMALL:
            return False
        weight = 1.0 / self.variances
        # One that went the other way by itself did not go with the others: it stayed, for this.
        toward = np.maximum(self.sizes * (np.sign(self.shared.value) or 1.0), 0.0)
        order = np.argsort(toward)
        toward, weight = toward[order], weight[order]
        one = _squares(toward, weight)
        least = [
            float(np.sum(weight[:m] * toward[:m] ** 2)) + _squares(toward[m:], weight[m:])
            for m in range(fewest, k)
            if np.average(toward[m:], weights=weight[m:]) > 0.0
        ]
        if not least:
            return False
        two = min(least)
        return one - two > APART * max(1.0, two / max(k - 2, 1))

    @property
    def telling(self) -> Places:
        """Vehicles whose step is told apart from none, and not apart from the shared one."""
        if not len(self.sizes):
            return self.members
        own = np.sqrt(self.variances)
        low = (1.0 - LEVEL) / 2.0 / len(self.sizes)
        near = -float(normal_quantiles(low)) * np.hypot(own, self.shared.stderr or 0.0)
        moved = self.sizes * np.sign(self.shared.value) > half_width(LEVEL) * own
        like_all = np.abs(self.sizes - self.shared.value) <= near
        return np.asarray(self.members[moved & like_all])


def own_steps(
    beside: Array, member: Places, day: Places, behind: NDArray[np.bool_], shared: Estimate
) -> OwnSteps:
    """Steps of each vehicle's days at one date, their errors by what all leave on either side.

    Parameters
    ----------
    beside : ndarray, shape (n,)
        Flights about their vehicle's median without what all share.
    member, day : ndarray, shape (n,)
    behind : ndarray of bool, shape (n,)
        Flights behind the date.
    shared : Estimate
        Step of all, to which what each vehicle moved beside it is added.
    """
    days = int(day.max()) + 1
    pairs, place = np.unique((member * days + day) * 2 + behind, return_inverse=True)
    means = np.bincount(place, weights=beside) / np.bincount(place)
    # Flights of one day share what it differs by: of each side its days count once.
    side, inverse = np.unique(pairs // (2 * days) * 2 + pairs % 2, return_inverse=True)
    counts = np.bincount(inverse)
    level = np.bincount(inverse, weights=means) / counts
    freedom = len(means) - len(side)
    both = np.flatnonzero((side[:-1] % 2 == 0) & (side[1:] == side[:-1] + 1))
    if freedom < 1 or not len(both):
        return OwnSteps(np.empty(0, dtype=np.intp), np.empty(0), np.empty(0), shared)
    of_day = float(np.sum((means - level[inverse]) ** 2)) / freedom
    of_day = max(of_day, float(np.finfo(np.float64).tiny))
    sizes = shared.value + level[both + 1] - level[both]
    variances = of_day * (1.0 / counts[both] + 1.0 / counts[both + 1])
    return OwnSteps(side[both] // 2, sizes, variances, shared)


def _squares(values: Array, weight: Array) -> float:
    """Cochran's Q of values about their own mean."""
    return float(np.sum(weight * (values - np.average(values, weights=weight)) ** 2))
