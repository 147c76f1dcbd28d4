"""Rounds of expectation and maximisation as they are written, beside the native ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from flightid.uncertainty.slow_drift import SETTLED, Drift, Spectral

Array = NDArray[np.float64]
M = TypeVar("M", bound=Spectral)


def parted(
    fitted: Callable[[Array], M], whole: Array, length: int, pair: tuple[M, Drift], rounds: int
) -> tuple[M, Drift]:
    """Both models after some rounds, or fewer where these change nothing any more.

    Parameters
    ----------
    fitted : callable
        Makes a model of a power.
    whole : ndarray, shape (n_bins,)
        Power at the bins of a real transform of `length`.
    length : int
    pair : tuple of model and Drift
    rounds : int
        Most of them.
    """
    fast, drift = pair
    ends = 1.0 if length % 2 == 0 else 2.0
    variance, (power, under) = drift.variance, drift._parts(length)
    shape = power / under
    for _ in range(rounds):
        other, own = fast.spectrum(), variance * shape
        share = own / np.maximum(other + own, np.finfo(float).tiny)
        mixed = share * other
        slow = share * share * whole + mixed
        rest = 1.0 - share
        fast = fitted(rest * rest * whole + mixed)
        total = 2.0 * np.sum(slow) - slow[0] - (2.0 - ends) * slow[-1]
        before, variance = variance, float(total) / length
        if abs(variance - before) <= SETTLED * before:
            break
    return fast, replace(drift, variance=variance)
