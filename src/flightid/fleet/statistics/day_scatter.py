"""How far days scatter about a level and one step: what days differ by, told by all of them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from flightid.fleet.statistics.step_chances import largest_step_chance
from flightid.frozen import dataclass
from flightid.uncertainty.quadrature import gauss_legendre

Array = NDArray[np.float64]
FEWEST_FREE = 3
"""Days, less the events between them, below which a level and a step leave nothing."""
SAME = 1e-9
"""Share of a step beside events, below which it is one of theirs."""
LARGEST = 7.5
"""Standard errors up to which moments of the largest step of chance are added up."""
NODES = 20


@dataclass(frozen=True, eq=False)
class DayMeans:
    """Days' means of vehicles that have as many days, and as many events between them.

    Attributes
    ----------
    means, variances : ndarray, shape (m, d)
        In order of time; variances are those that the flights of a day leave to its mean.
    design : ndarray, shape (m, d, 1 + e)
        A level, and the days behind each event.
    """

    means: Array
    variances: Array
    design: Array

    @property
    def free(self) -> int:
        """Days less events."""
        return int(self.means.shape[1] - self.design.shape[2] + 1)

    def left(self, added: float) -> float:
        """Squares about level, events and the largest step, each day with a variance more."""
        d = self.means.shape[1]
        weights = 1.0 / np.sqrt(self.variances + added)
        steps = np.tri(d, d - 1, -1)
        columns = np.concatenate(
            [self.means[:, :, None], np.broadcast_to(steps, (len(self.means), *steps.shape))], 2
        )
        q = np.linalg.qr(weights[:, :, None] * self.design)[0]
        columns = weights[:, :, None] * columns
        sizes = np.sum(columns**2, axis=1)
        columns = columns - q @ (np.swapaxes(q, 1, 2) @ columns)
        y, apart = columns[:, :, 0], columns[:, :, 1:]
        own = np.sum(apart**2, axis=1)
        known = own <= SAME * sizes[:, 1:]
        along = np.einsum("md,mdk->mk", y, apart) ** 2 / np.where(known, np.inf, own)
        return float(np.sum(y**2) - np.sum(np.max(along, axis=1)))


@dataclass(frozen=True)
class DayScatter:
    """What days differ by.

    Attributes
    ----------
    factor : float
        Of the variances that flights leave to a day's mean; 1 at least.
    added : float
        Variance beside these, in the square of the unit.
    freedom : float
        Degrees of freedom of either.
    """

    factor: float
    added: float
    freedom: float


def day_scatter(groups: Iterable[DayMeans]) -> DayScatter:
    """Estimate what days differ by from what a level and the largest step leave of all vehicles.

    A step of each is taken out whether it changed or not, at the place where it explains most. What
    normal days leave then is known exactly (`left_of_normal`), and the variance is the one at which
    they leave as much. Of vehicles that did change a step takes less than the largest of chance
    would: where all of them do, six days count for half wider than they are.

    Parameters
    ----------
    groups : iterable of DayMeans

    Returns
    -------
    DayScatter
        Without freedom where no vehicle has `FEWEST_FREE` days.

    Assumes
    -------
    Days differ alike on all vehicles, independently; a gradual movement counts in part.
    """
    kept = [each for each in groups if each.free >= FEWEST_FREE]
    moments = [(len(each.means), *left_of_normal(each.free)) for each in kept]
    mean = sum(m * one for m, one, _ in moments)
    variance = sum(m * one for m, _, one in moments)
    if not kept:
        return DayScatter(1.0, 0.0, 0.0)
    freedom = 2.0 * mean**2 / variance

    def beyond(added: float) -> float:
        return sum(each.left(added) for each in kept) / mean - 1.0

    factor = 1.0 + beyond(0.0)
    if factor <= 1.0:
        return DayScatter(1.0, 0.0, freedom)
    most = factor * max(float(np.max(each.variances)) for each in kept)
    return DayScatter(factor, float(brentq(beyond, 0.0, most, xtol=1e-9 * most)), freedom)


@cache
def left_of_normal(n: int) -> tuple[float, float]:
    """Mean and variance of what level and largest step leave of n normal numbers' squares.

    The largest step M is a share of all squares S that does not depend on these (Basu), so that
    E (S − M)² = E S² E (1 − M/S)²; the moments of M follow from its exact chances.

    Example
    -------
    >>> [round(one, 2) for one in left_of_normal(6)]
    [2.61, 4.26]
    """
    before = np.arange(1.0, n - 1.0)
    correlations = np.sqrt(before * (n - 1.0 - before) / ((before + 1.0) * (n - before)))
    nodes, weights = gauss_legendre(NODES)
    sizes, weights = 0.5 * LARGEST * (nodes + 1.0), 0.5 * LARGEST * weights
    chances = np.array([largest_step_chance(float(each**2), correlations) for each in sizes])
    first, second = (float(weights @ (p * sizes ** (p - 1.0) * chances)) for p in (2.0, 4.0))
    mean = n - 1.0 - first
    return mean, n**2 - 1.0 - 2.0 * (n + 1.0) * first + second - mean**2
