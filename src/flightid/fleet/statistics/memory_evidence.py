"""What days speak for one memory of theirs: a likelihood, averaged over what may have changed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.largest_step import NEWEST, SHORTEST
from flightid.frozen import dataclass

Array = NDArray[np.float64]
SPREADS = (2.0, 6.0, 18.0)
"""Spread of the sizes of changes, standard deviations of a typical day's mean, each as likely."""
COMMON = (2.0, 3.0, 4.5, 6.7, 10.0, 15.0)
"""Sizes of one change of many vehicles, of either sign: together as likely as the former."""
ABOUT_COMMON = 0.3
"""Spread about such a size, in shares of it."""
FEWEST_ALIKE = 3.0
"""Vehicles that have changed, of fewer of which no common size is asked."""
CHANGING = np.array([0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 0.9])
"""Share of vehicles that change, each as likely."""
ITERATIONS, SETTLED = 6, 0.03
"""In which the common factor settles within a share of itself."""


@dataclass(frozen=True, eq=False)
class DayGroup:
    """Days of vehicles that have as many of them, in units of a typical day's mean.

    Attributes
    ----------
    values, variances : ndarray, shape (m, d)
        Variances were days independent; 1 of a typical one.
    level : ndarray, shape (m, d, e)
        What may have any size: a level, and the steps of events.
    """

    values: Array
    variances: Array
    level: Array

    @property
    def free(self) -> int:
        """Days less what may have any size, of all vehicles."""
        return int(len(self.values) * (self.level.shape[1] - self.level.shape[2]))


@dataclass(frozen=True, eq=False)
class _ApartFromLevels:
    """Vehicles beside days of one memory: squares about a level, and what each change explains."""

    squares: Array
    along: Array
    information: Array
    priors: Array
    log_sizes: float
    free: int


def evidence(groups: Sequence[DayGroup], share: float, correlation: float) -> tuple[float, float]:
    """Log likelihood of days with one memory, and the factor of their variances.

        y = level + change + e,   cov e = f ((1 − c) v δ + c ρ^|lag|)

    Levels are free (restricted likelihood). A share π of the vehicles changes, at once or steadily,
    at any place; sizes are normal, about none or about one size common to all. Places, kinds,
    sizes and π are averaged over; f has its likeliest value.

    Parameters
    ----------
    groups : sequence of DayGroup
    share : float
        c, of a typical day's variance, that goes on; 0 of independent days.
    correlation : float
        ρ, from one day to the next.

    Returns
    -------
    log_likelihood, factor : float

    Reference
    ---------
    Patterson & Thompson, *Biometrika* 58 (1971), 545–554 (restricted likelihood); Kass & Raftery,
    *J. Am. Stat. Assoc.* 90 (1995), 773–795 (likelihoods averaged over what is unknown).
    """
    held = [_apart_from_levels(each, share, correlation) for each in groups]
    free = sum(each.free for each in held)
    spread = sum(float(each.squares.sum()) for each in held) / free
    if spread <= 0.0:
        return np.inf, 0.0
    starts = dict.fromkeys((min(1.0, spread), spread))
    best = max((*_at(held, free, each), each) for each in starts)
    log, left, factor = best
    for _ in range(ITERATIONS):
        if abs(left / factor - 1.0) < SETTLED:
            break
        factor = left
        log, left = _at(held, free, factor)
        best = max(best, (log, left, factor))
    return best[0], best[2]


def _apart_from_levels(group: DayGroup, share: float, correlation: float) -> _ApartFromLevels:
    d = group.values.shape[1]
    steps, ramps = change_shapes(d)
    shapes = np.hstack([steps, ramps])
    lag = np.abs(np.subtract.outer(np.arange(d), np.arange(d)))
    own = (1.0 - share) * group.variances[:, :, None] * np.eye(d)
    root = np.linalg.cholesky(share * correlation**lag + own)
    inverse = np.linalg.solve(root, np.eye(d))
    q, triangle = np.linalg.qr(inverse @ group.level)
    apart = np.concatenate([(inverse @ group.values[:, :, None]), inverse @ shapes], 2)
    apart = apart - q @ (np.swapaxes(q, 1, 2) @ apart)
    y, shapes = apart[:, :, 0], apart[:, :, 1:]
    # What an event or its level explains already is a change of no size.
    information = np.maximum(np.sum(shapes**2, axis=1), 1e-12)
    along = np.einsum("mdk,md->mk", shapes, y)
    sizes = np.log(np.abs(np.diagonal(triangle, axis1=1, axis2=2))).sum()
    sizes += np.log(np.diagonal(root, axis1=1, axis2=2)).sum()
    counts = [each.shape[1] for each in (steps, ramps)]
    priors = np.repeat([-np.log(2.0 * count) for count in counts], counts)
    return _ApartFromLevels(
        np.sum(y**2, axis=1), along, information, priors, -float(sizes), group.free
    )


def change_shapes(days: int) -> tuple[Array, Array]:
    """Column by column: steps before each day that may be one, and steady movements from each on.

    Example
    -------
    >>> steps, ramps = change_shapes(7)
    >>> steps.T.astype(int).tolist()
    [[0, 0, 0, 1, 1, 1, 1], [0, 0, 0, 0, 1, 1, 1], [0, 0, 0, 0, 0, 1, 1]]
    >>> ramps[:, 3].round(2).tolist()
    [0.0, 0.0, 0.0, 0.0, 0.33, 0.67, 1.0]
    """
    at, first = np.arange(float(days)), np.arange(SHORTEST, days - NEWEST + 1)
    steps = (at[:, None] >= first).astype(np.float64)
    begun = np.arange(float(days - SHORTEST))
    return steps, np.maximum(at[:, None] - begun, 0.0) / (days - 1.0 - begun)


def _at(held: Sequence[_ApartFromLevels], free: int, factor: float) -> tuple[float, float]:
    """Log likelihood at one factor, and the factor that squares beside changes leave."""
    squares = sum(float(each.squares.sum()) for each in held)
    alone = sum(each.log_sizes for each in held)
    alone -= 0.5 * (free * np.log(factor) + squares / factor)
    about = [(0.0, spread) for spread in SPREADS]
    log, changed, explained = _changes(held, factor, about)
    if changed >= FEWEST_ALIKE:
        about = [(sign * size, ABOUT_COMMON * size) for size in COMMON for sign in (-1.0, 1.0)]
        other = _changes(held, factor, about)
        both = float(np.logaddexp(log, other[0]))
        weight = float(np.exp(other[0] - both))
        explained = (1.0 - weight) * explained + weight * other[2]
        log = both - float(np.log(2.0))
    return alone + log, (squares - explained) / free


def _changes(
    held: Sequence[_ApartFromLevels], factor: float, about: Sequence[tuple[float, float]]
) -> tuple[float, float, float]:
    """Log of how much likelier changes make it all, how many vehicles change, what that explains.

    Sizes are normal about a mean by a spread, each pair as likely.
    """
    means, spreads = np.array(about).T
    pairs = [_beside_changes(each, factor, means, spreads) for each in held]
    likelier = np.concatenate([each for each, _ in pairs])[:, :, None]
    explained = np.concatenate([each for _, each in pairs])
    each = np.logaddexp(np.log1p(-CHANGING), np.log(CHANGING) + likelier)
    every = each.sum(axis=0)
    most = float(every.max())
    weights = np.exp(every - most)
    log = most + float(np.log(weights.mean()))
    weights /= weights.sum()
    changed = np.sum(np.exp(np.log(CHANGING) + likelier - each) * weights, axis=2)
    return log, float(changed.sum()), float(np.sum(changed * explained))


def _beside_changes(
    held: _ApartFromLevels, factor: float, means: Array, spreads: Array
) -> tuple[Array, Array]:
    """Of each vehicle by prior of sizes: how much likelier a change makes it, and its squares."""
    information = held.information[:, :, None] / factor
    along = held.along[:, :, None] / factor
    shrunk = 1.0 / (1.0 + spreads**2 * information)
    off = along / np.sqrt(information) - means * np.sqrt(information)
    gained = along**2 / information
    log = 0.5 * (gained - off**2 * shrunk + np.log(shrunk)) + held.priors[:, None]
    most = log.max(axis=1, keepdims=True)
    weights = np.exp(log - most)
    total = weights.sum(axis=1)
    squares = np.sum(weights * (gained - (off * shrunk) ** 2), axis=1) / total
    return most[:, 0] + np.log(total), factor * squares
