"""Which stamps of a message can be believed: a damaged one must not spoil a whole log."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

from flightid.logs import Log

LONGEST_LOG_S = 1e6
"""Eleven days: stamps spread over more than that mean nothing, s."""
MARGIN = 0.2
"""A stamp may lie so many spans of the middle 98 % outside of them."""
SLACK_S = 1.0


def believable(time_s: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which stamps belong to the most numerous increasing sequence.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Stamps in file order, s.

    Returns
    -------
    ndarray of bool, shape (n,)
        All false where the stamps spread over more than `LONGEST_LOG_S`.

    Example
    -------
    >>> believable(np.array([1.0, 2.0, 9.0, 3.0, 3.0, 4.0])).tolist()
    [True, True, False, False, True, True]
    """
    mask = np.isfinite(time_s)
    if not np.any(mask):
        return mask
    low, high = np.percentile(time_s[mask], [1, 99])
    if high - low > LONGEST_LOG_S:
        return np.zeros_like(mask)
    margin = MARGIN * (high - low) + SLACK_S
    mask &= (time_s >= low - margin) & (time_s <= high + margin)
    kept = np.flatnonzero(mask)
    if kept.size > 1 and np.any(np.diff(time_s[kept]) <= 0):
        mask[kept] = _longest_increasing(time_s[kept])
    return mask


def _longest_increasing(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask of a longest strictly increasing subsequence (patience sorting)."""
    ends: list[float] = []
    places: list[int] = []
    before = np.full(values.size, -1, dtype=np.intp)
    for index, value in enumerate(values.tolist()):
        length = bisect_left(ends, value)
        if length:
            before[index] = places[length - 1]
        if length == len(ends):
            ends.append(value)
            places.append(index)
        else:
            ends[length], places[length] = value, index
    mask = np.zeros(values.size, dtype=np.bool_)
    at = places[-1]
    while at >= 0:
        mask[at] = True
        at = int(before[at])
    return mask


def log_span(log: Log) -> tuple[float, float]:
    """First and last believable stamp of the message with the most rows, s; zeros without any."""
    stamped = [info for info in log.messages.values() if info.rate_hz is not None]
    for info in sorted(stamped, key=lambda info: -info.count):
        instance = info.instances[0] if info.instances else None
        time_s = log.table(info.name, instance).time_s
        good = time_s[believable(time_s)]
        if good.size > 1:
            return float(good[0]), float(good[-1])
    return 0.0, 0.0
