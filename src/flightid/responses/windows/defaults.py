"""Window lengths and frequency bands: the rules, and the defaults that follow from them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError
from flightid.responses.windows.transform import WindowPlan

CYCLES_AT_LOWEST = 2.0
"""Cycles of the lowest trustworthy frequency that a window must hold."""
CYCLES_AT_HIGHEST = 20.0
"""Cycles of the highest frequency that the shortest automatic window holds."""
WINDOWS_IN_RECORDS = 5.0
"""Independent windows of the longest automatic length in all records together."""
HIGHEST_FRACTION = 0.2
"""Highest trustworthy frequency as a fraction of the sampling rate."""
AUTOMATIC_LENGTHS = 5
DEFAULT_FREQUENCIES = 100
DEFAULT_OVERLAP = 0.5
MINIMUM_LENGTH = 8


def shifts_of(overlap: float) -> int:
    """Hops in a window for an overlap of 0, 1/2, 2/3, 3/4, 4/5 and so on.

    Raises
    ------
    OptionError
        The overlap is not ``1 − 1/m`` for a whole m.

    Example
    -------
    >>> shifts_of(0.5), shifts_of(0.8)
    (2, 5)
    """
    shifts = round(1.0 / (1.0 - overlap)) if 0.0 <= overlap < 0.95 else 0
    if shifts < 1 or abs(1.0 - 1.0 / shifts - overlap) > 1e-3:
        raise OptionError(
            "overlap is not a whole number of hops in a window",
            found=overlap,
            needed="1 - 1/m, such as 0, 0.5, 0.75 or 0.8",
        )
    return shifts


def overlap_factor(shifts: int) -> float:
    """Factor of the random error for overlapped Hann windows.

    √0.55 at 50 % and √0.50 at 80 %; between and beyond these the nearer of the two holds, and no
    overlap gives 1.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., section 7.
    """
    if shifts == 1:
        return 1.0
    return math.sqrt(0.55) if shifts <= 3 else math.sqrt(0.50)


def plan_of(window_s: float, sample_time_s: float, shifts: int) -> WindowPlan:
    """Window plan whose length is `window_s` rounded to an even number of whole hops."""
    multiple = math.lcm(2, shifts)
    length = multiple * max(1, round(window_s / sample_time_s / multiple))
    return WindowPlan(length, shifts)


def automatic_windows(durations_s: Sequence[float], omega_max: float) -> tuple[float, ...]:
    """Five window lengths, log-spaced, longest first.

    The longest is the smaller of half the longest record and a fifth of all records together; the
    shortest holds twenty cycles of the highest frequency. Where these two meet there is one length.

    Parameters
    ----------
    durations_s : sequence of float
        Length of each record, s.
    omega_max : float
        Highest frequency of interest, rad/s.

    Returns
    -------
    tuple of float
        Window lengths, s.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., sections 7 and 10.

    Example
    -------
    >>> automatic_windows([100.0, 100.0], 40.0)
    (40.0, 21.1..., 11.2..., 5.9..., 3.1...)
    """
    return windows_up_to(longest_window(durations_s), omega_max)


def windows_up_to(longest_s: float, omega_max: float) -> tuple[float, ...]:
    """Five window lengths as by `automatic_windows`, below a longest one, s."""
    shortest = min(longest_s, CYCLES_AT_HIGHEST * 2.0 * math.pi / omega_max)
    if shortest > 0.8 * longest_s:
        return (longest_s,)
    return tuple(float(t) for t in np.geomspace(longest_s, shortest, AUTOMATIC_LENGTHS))


def longest_window(durations_s: Sequence[float]) -> float:
    """Longest automatic window for records of these lengths, s."""
    return min(max(durations_s) / 2.0, math.fsum(durations_s) / WINDOWS_IN_RECORDS)


def default_frequencies(
    longest_s: float, sample_time_s: float, n_omega: int
) -> NDArray[np.float64]:
    """Log-spaced, rad/s: from two cycles in the longest window to a fifth of the sampling rate."""
    low = CYCLES_AT_LOWEST * 2.0 * math.pi / longest_s
    high = HIGHEST_FRACTION * 2.0 * math.pi / sample_time_s
    if low >= high:
        raise DataError(
            "the records are too short for a frequency response",
            found=f"a longest window of {longest_s:.3g} s at {1 / sample_time_s:.4g} Hz",
            needed=f"more than {CYCLES_AT_LOWEST / HIGHEST_FRACTION:.0f} samples in it",
        )
    return np.geomspace(low, high, n_omega)
