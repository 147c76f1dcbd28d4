"""What a noise model may leave out of a response: coarser models of the same records asked beside.

Records bound how far back a long ARX model can look, and blocks of far lags have one number each.
Slow modes reach farther and turn within a block, and bend the response by more than its random
error: no noise tells that, a shorter memory and wider blocks do.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.responses.errors.prewhitened import OCTAVE, NoiseModel

Real = NDArray[np.float64]

HALF = 0.5
COARSER: tuple[tuple[float, int], ...] = ((HALF, OCTAVE), (1.0, OCTAVE // 2))
"""Shares of the memory and blocks to an octave of what is asked beside: each a half by itself."""
WIDE = 0.5
"""Octaves to either side over which the change is averaged: at one frequency it may be none."""
MOST = 1.0
"""Largest change that counts, over the response: beyond it nothing is known."""
NOTHING = 1e3
"""Doubt over the response where an input has no power of its own: no bar tells anything there."""
TINY = float(np.finfo(float).tiny)


def near(omega_rad_s: Real) -> Real:
    """Which frequencies lie within half an octave of which, shape (n_f, n_f)."""
    away = np.abs(np.subtract.outer(np.log2(omega_rad_s), np.log2(omega_rad_s)))
    return np.asarray(away <= WIDE, dtype=np.float64)


def model_doubt(
    model: NoiseModel,
    variance: Real,
    coarser: Sequence[tuple[NoiseModel, Real]],
    omega_rad_s: Real,
) -> Real:
    """Standard deviation of complex points by what coarser models move, (n_out, n_in, n_f).

    A bias that falls as memory grows and blocks narrow moves at least as much at its next halving
    as it still is. Both halvings show the same bias, so the larger counts. What chance moves
    between nested models, the difference of their variances, is taken off, and the square is
    averaged over an octave. Where a cycle is longer than the memory it grows as that ratio.

    Parameters
    ----------
    model : NoiseModel
    variance : ndarray, shape (n_out, n_in, n_f)
        Of its complex points.
    coarser : sequence of (NoiseModel, ndarray)
        With less memory or wider blocks, and their variances.
    omega_rad_s : ndarray, shape (n_f,)

    Assumes
    -------
    A bias that shrinks as the model grows; docs/responses.md has counts.
    """
    response = model.response(omega_rad_s)
    square = np.maximum(np.abs(response) ** 2, TINY)
    share, around = np.zeros_like(square), near(omega_rad_s)
    for other, known in coarser:
        moved = np.abs(other.response(omega_rad_s) - response) ** 2
        beyond = np.maximum(moved - np.maximum(variance - known, 0.0), 0.0)
        most = np.minimum(beyond / square, MOST)
        share = np.maximum(share, (most @ around) / around.sum(axis=0))
    short = np.maximum(2.0 * np.pi / (model.memory_s * omega_rad_s), 1.0)
    return np.asarray(np.sqrt(square * share) * short)
