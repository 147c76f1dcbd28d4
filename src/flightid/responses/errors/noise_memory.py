"""What the memory of a noise model may leave out of a response: a model of half of it asked beside.

Records bound how far back a long ARX model can look. Slow modes reach farther, and bend the
response low in the band by more than its random error: no noise tells that, another memory does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.responses.errors.prewhitened import NoiseModel

Real = NDArray[np.float64]

HALF = 0.5
WIDE = 0.5
"""Octaves to either side over which the change is averaged: at one frequency it may be none."""
MOST = 1.0
"""Largest change that counts, over the response: beyond it nothing is known."""
TINY = float(np.finfo(float).tiny)


def near(omega_rad_s: Real) -> Real:
    """Which frequencies lie within half an octave of which, shape (n_f, n_f)."""
    away = np.abs(np.subtract.outer(np.log2(omega_rad_s), np.log2(omega_rad_s)))
    return np.asarray(away <= WIDE, dtype=np.float64)


def memory_doubt(
    model: NoiseModel,
    shorter: NoiseModel,
    omega_rad_s: Real,
    variances: tuple[Real, Real],
) -> Real:
    """Standard deviation of complex points by what half the memory moves, (n_out, n_in, n_f).

    A bias that falls as memory grows moves at least as much at its next halving as it still is.
    What chance moves between nested models, the difference of their variances, is taken off, and
    the square is averaged over an octave. Where a cycle is longer than the memory it grows as the
    square of that ratio.

    Parameters
    ----------
    model, shorter : NoiseModel
        Of the whole memory and of half of it.
    omega_rad_s : ndarray, shape (n_f,)
    variances : (ndarray, ndarray), each shape (n_out, n_in, n_f)
        Of complex points of both.

    Assumes
    -------
    A bias that shrinks with the memory: low in short stretches some intervals still miss
    (docs/responses.md has the counts).
    """
    response = model.response(omega_rad_s)
    square = np.maximum(np.abs(response) ** 2, TINY)
    moved = np.abs(shorter.response(omega_rad_s) - response) ** 2
    beyond = np.maximum(moved - np.maximum(variances[0] - variances[1], 0.0), 0.0)
    share = np.minimum(beyond / square, MOST)
    around = near(omega_rad_s)
    short = np.maximum(2.0 * np.pi / (model.memory_s * omega_rad_s), 1.0)
    return np.asarray(np.sqrt(square * (share @ around) / around.sum(axis=0)) * short)
