"""Which stamps of a message can be believed: a damaged one must not spoil a whole log."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flightid.logs import Log

LONGEST_LOG_S = 1e6
"""Eleven days: stamps spread over more than that mean nothing, s."""
MARGIN = 0.2
"""A stamp may lie so many spans of the middle 98 % outside of them."""
SLACK_S = 1.0
"""And so many seconds."""
BLOCK = 1 << 16
"""Steps looked at together: stamps of a large log are not held twice."""
INNER = (0.01, 0.99)
"""Shares of the stamps below and above which some may be damage."""


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
    if _are_all_believable(time_s):
        return np.ones(time_s.shape, np.bool_)
    mask = np.isfinite(time_s)
    if not np.any(mask):
        return mask
    first, last = _limits(*np.percentile(time_s[mask], np.multiply(100.0, INNER)))
    mask &= (time_s >= first) & (time_s <= last)
    kept = np.flatnonzero(mask)
    if kept.size > 1 and np.any(np.diff(time_s[kept]) <= 0):
        mask[kept] = _longest_increasing(time_s[kept])
    return mask


def believed(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stamps that are `believable`: the array itself where all are."""
    return time_s if _are_all_believable(time_s) else time_s[believable(time_s)]


def longer_steps(time_s: NDArray[np.float64], limit_s: float) -> list[tuple[float, float]]:
    """Stamps before and after each step above a limit, s."""
    return [
        (float(part[at]), float(part[at + 1]))
        for part in _parts(time_s)
        for at in np.flatnonzero(np.diff(part) > limit_s)
    ]


def _parts(time_s: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Blocks of steps: each begins with the stamp that the one before ends with."""
    for first in range(0, max(time_s.size - 1, 0), BLOCK):
        yield time_s[first : first + BLOCK + 1]


def _are_all_believable(time_s: NDArray[np.float64]) -> bool:
    """Tell by a pass without copies that stamps increase and none lies far from the others."""
    if time_s.size == 0 or not all(np.all(part[1:] > part[:-1]) for part in _parts(time_s)):
        return False
    places = np.multiply(INNER, time_s.size - 1)
    # Percentiles of what is sorted, rounded to a stamp, to the side that finds fault.
    first, last = _limits(time_s[int(np.ceil(places[0]))], time_s[int(places[1])])
    return bool(first <= time_s[0] and time_s[-1] <= last)


def _limits(low: float, high: float) -> tuple[float, float]:
    """First and last stamp that can be believed, by those below and above which 1 % lie, s."""
    if high - low > LONGEST_LOG_S:
        return np.inf, -np.inf
    margin = MARGIN * (high - low) + SLACK_S
    return low - margin, high + margin


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
        good = believed(time_s)
        if good.size > 1:
            return float(good[0]), float(good[-1])
    return 0.0, 0.0
