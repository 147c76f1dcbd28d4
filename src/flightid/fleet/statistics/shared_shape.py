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
"""By how much the best date of a step, and of a wave, lowers the squares more, in variances."""
APART = 6.0
"""By how much squares differ, in variances, where one of two shapes is told (20 to 1)."""

WAVELIKE = 5
"""Levels, up to which a wave over the whole time says nothing beside a step."""


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
    """Hold a step and a line beside a shared level; neither where one wave fits better than both.

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
    turn = 2.0 * np.pi * (at - at[0]) / max(np.ptp(at) * len(at) / max(len(at) - 1, 1), 1e-9)
    wave = np.column_stack([np.sin(turn), np.cos(turn)])
    courses = (after.astype(np.float64)[:, None], at[:, None], wave)
    left = np.array([_left(level, counts, each) for each in courses])
    every = np.maximum(whole - (len(level) - 1) * of_error, whole - left)
    fits = whole - left >= FITS * every
    error = max(of_error, float(left.min()) / max(len(level) - 3, 1))
    step, line, season = left + SEARCHED * error * np.array([1.0, 0.0, 1.0])
    if whole == 0.0 or (len(level) > WAVELIKE and season < min(step, line)):
        return SharedShape(may_step=False, may_line=False)
    near = bool(np.any(fits[:2]) and abs(line - step) <= APART * error)
    return SharedShape(
        may_step=near or bool(fits[0] and step < line),
        may_line=near or bool(fits[1] and line < step),
    )


def _left(level: Array, counts: Array, course: Array) -> float:
    """Squares that a level and a course of any size leave."""
    root = np.sqrt(counts)
    design = root[:, None] * np.column_stack([np.ones(len(level)), course])
    left = root * level - design @ np.linalg.lstsq(design, root * level, rcond=None)[0]
    return float(left @ left)
