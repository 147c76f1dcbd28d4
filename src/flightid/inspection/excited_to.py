"""Where the power of an excitation ends: above it a closed loop shows itself, and no model.

Beyond its last frequency a sweep leaves noise and harmonics that the loop feeds back. Command and
rate hang together there as well, so their coherence is near one, but by the inverse of the
controller and not by the vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from flightid.inspection.axes import axes_of
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.signals import Span, find, inside
from flightid.inspection.thresholds import EXCITED_POWER, OF_SWEEP
from flightid.logs import Log

Array = NDArray[np.float64]
PIECES = 8
"""Windows of a run in its spectrum, besides the half of one on each side of it."""
LEAST_SAMPLES = 64
"""Samples of a run without which its spectrum tells nothing."""
SHORTEST = 16
"""Samples of the shortest piece."""


def excited_to(log: Log, axis: str, excited: Iterable[FoundExcitation]) -> float:
    """Highest frequency that the sweeps of an axis put power into, rad/s.

    Parameters
    ----------
    log : Log
    axis : str
        ``"roll"``, ``"pitch"`` or ``"yaw"``.
    excited : iterable of FoundExcitation

    Returns
    -------
    float
        Of the run that reaches highest: the frequency up to which the measured power in equal
        parts of a decade is within 20 dB of its most, and for runs of the system-identification
        mode at most 0.75 of the logged stop frequency (the fade-out takes the rest). Infinite
        without a sweep, where nobody knows what excited the axis.
    """
    sweeps = [e for e in excited if e.axis == axis and e.kind in ("sid", "chirp", "sweep")]
    return max((_end(log, axis, each) for each in sweeps), default=math.inf)


def _end(log: Log, axis: str, sweep: FoundExcitation) -> float:
    """Of one run, rad/s."""
    span = sweep.start_s, sweep.stop_s
    if sweep.kind != "sid":
        signal = find(log, axes_of(log.vehicle)[axis].set_point)
        return math.inf if signal is None else _power_end(signal.time_s, signal.values, span)
    table = log.table("SIDD")
    measured = _power_end(table.time_s, table["Targ"], span)
    alike = [run for run in log.sid_runs if run.chirp_span_s == span]
    known = [OF_SWEEP.value * max(run.f_start_hz, run.f_stop_hz) for run in alike]
    # A run that was broken off never came to its last frequency: the mode logs where it was.
    flown = table["F"][inside(table.time_s, [span])]
    known += [float(flown.max())] if flown.size and flown.max() > 0.0 else []
    return min(measured, *(math.tau * each for each in known), math.inf)


def _power_end(time_s: Array, values: Array, span: Span) -> float:
    """Highest frequency with power, rad/s; infinite where there are too few samples to tell."""
    mask = inside(time_s, [span]) & np.isfinite(values)
    stamps, kept = time_s[mask], values[mask]
    steps = np.diff(stamps)
    if kept.size < LEAST_SAMPLES or np.ptp(kept) == 0.0 or np.any(steps <= 0.0):
        return math.inf
    step = float(np.median(steps))
    even = np.interp(np.arange(stamps[0], stamps[-1], step), stamps, kept)
    return power_end(even - even.mean(), 1.0 / step)


def power_end(values: Array, sample_rate_hz: float) -> float:
    """Highest frequency of a signal with power, rad/s.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Without their mean.
    sample_rate_hz : float

    Returns
    -------
    float
        Above it the power in equal parts of a decade, ω·S(ω), stays 20 dB below its most: what an
        exponential sweep keeps level from its first to its last frequency.

    Reference
    ---------
    Welch, *IEEE Trans. Audio Electroacoust.* 15 (1967), 70–73.

    Example
    -------
    >>> t = np.arange(0.0, 60.0, 0.01)
    >>> end = power_end(np.sin(2.0 * np.pi * (0.2 * t + 0.04 * t**2)), 100.0)
    >>> round(float(end) / (2.0 * np.pi))                             # 0.2 to 5 Hz
    5
    """
    window = max(values.size // PIECES, SHORTEST)
    # Mirrored ends give the first and last samples the weight of all others, without a jump.
    padded = np.pad(values, window // 2, mode="reflect", reflect_type="odd")
    pieces = np.lib.stride_tricks.sliding_window_view(padded, window)[:: window // 2]
    spectra = np.fft.rfft(pieces * np.hanning(window), axis=1)
    power = np.mean(np.abs(spectra) ** 2, axis=0)
    hertz = np.fft.rfftfreq(window, 1.0 / sample_rate_hz)
    level = hertz * power
    strong = np.flatnonzero(level >= EXCITED_POWER.value * level.max())
    return float(math.tau * hertz[strong[-1]])
