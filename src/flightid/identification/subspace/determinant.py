"""The size of innovations of several outputs, and how far a search is to go for it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FAR = 0.01
"""Share of a missing gain that a step must bring for the search of a rival order to go on."""


def log_determinant(errors: tuple[Array, ...]) -> float:
    """Of the covariance of errors; minus infinity where they are rounding."""
    joint = np.hstack(errors)
    covariance = joint @ joint.T / joint.shape[1]
    sign, value = np.linalg.slogdet(covariance)
    return float(value) if sign > 0 and value > -60.0 * len(joint) else -math.inf


class Goal:
    """A log determinant, and whether a search that begins at one of `level` reaches it.

    Whitened by the errors' own covariance, a search of smaller squares bounds the determinant:
    det S ≤ (tr S / p)ᵖ.
    """

    def __init__(self, level: float, goal: float, n_rows: int) -> None:
        self._first, self._last, self._goal, self._rows = level, level, goal, n_rows
        self.is_known = False

    def is_decided(self, p: int, cost: float) -> bool:
        """Whether a search of p outputs with so much left is there, or far from being there."""
        level = self._first + p * math.log(max(cost, 1e-300) / self._rows)
        gained, self._last = self._last - level, min(level, self._last)
        missing = level - self._goal
        self.is_known = missing <= 0.0 or 0.0 < gained < FAR * missing
        return self.is_known
