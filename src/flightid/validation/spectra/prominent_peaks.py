"""Peaks that stand out of what lies about them: `scipy.signal` takes a second to load."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def prominent_peaks(level: Array, least: Array) -> list[int]:
    """Places of the peaks of a curve whose prominence reaches a least one.

    The prominence of a peak is its height above the higher of the two lowest points between it and
    higher ground, or the end, on either side. Of a plateau the middle counts; ends are no peaks.

    Parameters
    ----------
    level : ndarray, shape (n,)
    least : ndarray, shape (n,)
        Least prominence of a peak at each place.

    Returns
    -------
    list of int
        In rising order, as ``scipy.signal.find_peaks`` has them.

    Example
    -------
    >>> curve = np.array([0.0, 3.0, 2.5, 5.0, 5.0, 0.0])
    >>> prominent_peaks(curve, np.full(6, 1.0))
    [3]
    """
    return [place for place in _tops(level) if _prominence(level, place) >= least[place]]


def _tops(level: Array) -> list[int]:
    """Middles of stretches of one height that both neighbours lie below."""
    runs: list[tuple[float, int, int]] = []
    start = 0
    for height, same in groupby(level.tolist()):
        stop = start + sum(1 for _ in same)
        runs.append((height, start, stop - 1))
        start = stop
    inner = zip(runs, runs[1:], runs[2:], strict=False)
    return [(a + b) // 2 for before, (top, a, b), after in inner if before[0] < top > after[0]]


def _prominence(level: Array, place: int) -> float:
    top = level[place]
    lowest = []
    for side in (level[place::-1], level[place:]):
        higher = np.flatnonzero(side > top)
        lowest.append(float(side[: higher[0] if higher.size else None].min()))
    return float(top - max(lowest))
