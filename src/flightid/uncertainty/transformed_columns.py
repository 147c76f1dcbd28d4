"""Columns of samples by the bins of their transforms, and products over these."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
AT_ONCE = 8192
"""Real and imaginary parts of bins that are turned together."""


def powers_of(form: Array, part: Array) -> Array:
    """Quadratic form in the transforms of each bin, by spans of bins that stay in the cache."""
    found = np.empty(part.shape[1] // 2)
    for begin in range(0, part.shape[1], AT_ONCE):
        here = part[:, begin : begin + AT_ONCE]
        power = np.einsum("kb,kb->b", form @ here, here)
        found[begin // 2 : (begin + AT_ONCE) // 2] = power[::2] + power[1::2]
    return found


def squares_of(part: Array, weights: Array) -> Array:
    """Products of transforms with the weights of their bins."""
    return np.asarray((part * weights) @ part.T)


def transforms(columns: Array, length: int) -> Array:
    """Transforms of columns (n, k), real and imaginary parts in turn: (k, 2 n_bins)."""
    return np.asarray(scipy.fft.rfft(np.ascontiguousarray(columns.T), length).view(np.float64))


def of_both(weights: Array) -> Array:
    """Weights of bins for the real and the imaginary part of each."""
    return np.repeat(weights, 2)
