"""The BCG vaccine trials of Colditz et al., JAMA 271 (1994): what a meta-analysis is held to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Cases and others, vaccinated and not, of 13 trials.
COUNTS = np.array([
    [4, 119, 11, 128], [6, 300, 29, 274], [3, 228, 11, 209], [62, 13536, 248, 12619],
    [33, 5036, 47, 5761], [180, 1361, 372, 1079], [8, 2537, 10, 619], [505, 87886, 499, 87892],
    [29, 7470, 45, 7232], [17, 1699, 65, 1600], [186, 50448, 141, 27197], [5, 2493, 3, 2338],
    [27, 16886, 29, 17825],
])  # fmt: skip


def log_ratios() -> tuple[list[str], Array, Array]:
    """Names of the trials, logarithms of their relative risks, and variances of those."""
    cases, others, controls, rest = COUNTS.T
    ratio = np.log(cases / (cases + others)) - np.log(controls / (controls + rest))
    variance = 1 / cases - 1 / (cases + others) + 1 / controls - 1 / (controls + rest)
    return [f"{i:02}" for i in range(len(COUNTS))], ratio, variance
