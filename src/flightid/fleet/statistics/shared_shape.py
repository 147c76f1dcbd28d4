"""The shape of what all vehicles share by date: at once, steadily, or neither."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
FITS = 0.87
"""Share of the squares of a shared level, its errors taken off, from which a shape is its: a step
explains 81 % of a wave and 75 % of a line, a line 61 % of a wave and 75 % of a step."""
SEARCHED = 2.0
"""By how much the best date of a step alone lowers the squares, in variances."""
APART = 6.0
"""By how much squares differ, in variances, where one of two shapes is told (20 to 1)."""


@dataclass(frozen=True)
class SharedShape:
    """Which of two shapes a shared level may have; both where its days do not tell.

    Attributes
    ----------
    may_step, may_line : bool
    """

    may_step: bool
    may_line: bool


def shared_shape(
    level: Array, variance: Array, counts: Array, at: Array, after: NDArray[np.bool_]
) -> SharedShape:
    """Hold a step and a line beside a shared level.

    Parameters
    ----------
    level, variance, counts, at : ndarray, shape (m,)
        Of days or weeks: level and its variance, flights, and when.
    after : ndarray of bool, shape (m,)
        Behind the step that explains most.

    Example
    -------
    >>> at, many = np.arange(12.0), np.full(12, 6.0)
    >>> shared_shape(0.1 * at, np.full(12, 1e-4), many, at, at > 5.0)
    SharedShape(may_step=False, may_line=True)
    >>> shared_shape(0.01 * at, np.full(12, 1e-2), many, at, at > 5.0)
    SharedShape(may_step=True, may_line=True)
    """
    whole = float(counts @ (level - np.average(level, weights=counts)) ** 2)
    of_error = float(np.mean(counts * variance))
    left = np.array([_left(level, counts, each) for each in (after.astype(np.float64), at)])
    every = np.maximum(whole - (len(level) - 1) * of_error, whole - left)
    fits = whole - left >= FITS * every
    error = max(of_error, float(left.min()) / max(len(level) - 3, 1))
    apart = left[1] - left[0] - SEARCHED * error
    near = abs(apart) <= APART * error
    may_step = (fits[0] and (apart > 0.0 or near)) or (fits[1] and near)
    may_line = (fits[1] and (apart < 0.0 or near)) or (fits[0] and near)
    return SharedShape(bool(may_step and whole > 0.0), bool(may_line and whole > 0.0))


def _left(level: Array, counts: Array, course: Array) -> float:
    """Squares that a level and a course of any size leave."""
    root = np.sqrt(counts)
    design = root[:, None] * np.column_stack([np.ones(len(level)), course])
    left = root * level - design @ np.linalg.lstsq(design, root * level, rcond=None)[0]
    return float(left @ left)
