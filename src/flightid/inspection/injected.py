"""What an injection explains of the rate it was to move: a loop makes coherence of gusts as well.

In a closed loop command and rate hang together whether or not anything was injected, by way of the
controller. What was injected knows no gust: where it explains little of the rate, what is coherent
is the loop.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.signals import Signal, Span, inside
from flightid.inspection.thresholds import (
    CYCLES_IN_WINDOW,
    MINIMUM_COHERENCE,
    SAMPLES_PER_CYCLE_LEAST,
)
from flightid.logs import Log
from flightid.responses.bands import coherent_parts
from flightid.responses.running import SpectralSum

Array = NDArray[np.float64]
SHARES = (0.25, 0.1)
"""Windows, of the longest run."""
N_OMEGA = 40
"""Frequencies of its responses."""
LEAST_SAMPLES = 64
"""Samples of a run that is looked at."""


@dataclass(frozen=True)
class InjectedShare:
    """What an injection explains of a rate.

    Attributes
    ----------
    width : float
        Highest over lowest frequency of the widest coherent band; 1 without one.
    largest : float
        Largest coherence at any frequency.
    """

    width: float
    largest: float


def injected_share(
    log: Log, axis: str, excited: Iterable[FoundExcitation], rate: Signal, highest_rad_s: float
) -> InjectedShare | None:
    """How far a rate is coherent with what was injected into its axis.

    Parameters
    ----------
    log : Log
    axis : str
        ``"roll"``, ``"pitch"`` or ``"yaw"``.
    excited : iterable of FoundExcitation
    rate : Signal
        Body rate.
    highest_rad_s : float
        Where the power of the injection ends, rad/s.

    Returns
    -------
    InjectedShare or None
        None where nothing was injected whose
        waveform was logged, or too little of it to tell.

    Reference
    ---------
    Bendat & Piersol, *Engineering Applications of Correlation and Spectral Analysis*, 2nd ed.,
    chapter 6.
    """
    runs = [e for e in excited if e.axis == axis and e.kind == "sid"]
    if not runs or "SIDD" not in log:
        return None
    table = log.table("SIDD")
    waveform = Signal("injected", table.time_s, np.asarray(table["Targ"], dtype=float), "", "")
    slower = min(waveform.rate_hz, rate.rate_hz)
    pieces = [_even(waveform, rate, (e.start_s, e.stop_s), 1.0 / slower) for e in runs]
    kept = [each for each in pieces if each.shape[1] >= LEAST_SAMPLES and np.ptp(each[0]) > 0.0]
    if not kept:
        return None
    windows = [share * max(each.shape[1] for each in kept) / slower for share in SHARES]
    low = 2.0 * np.pi * CYCLES_IN_WINDOW.value / windows[0]
    high = min(highest_rad_s, 2.0 * np.pi * slower / SAMPLES_PER_CYCLE_LEAST.value)
    if high <= low:
        return None
    omega = np.geomspace(low, high, N_OMEGA)
    total = SpectralSum(("injected", "rate"), windows, omega, 1.0 / slower)
    for each in kept:
        total.add(each)
    try:
        coherence = total.composite(["injected"], ["rate"]).coherence[0, 0]
    except FlightidError:
        return None
    parts = coherent_parts(omega, coherence, MINIMUM_COHERENCE.value)
    width = max((last / first for first, last in parts), default=1.0)
    return InjectedShare(width, float(np.max(coherence)))


def _even(waveform: Signal, rate: Signal, span: Span, step_s: float) -> Array:
    """Both signals on one grid inside a span, shape (2, n)."""
    stamps = np.arange(*span, step_s)
    rows = []
    for each in (waveform, rate):
        near = inside(each.time_s, [(span[0] - 1.0, span[1] + 1.0)]) & np.isfinite(each.values)
        if np.count_nonzero(near) < LEAST_SAMPLES:
            return np.zeros((2, 0))
        rows.append(np.interp(stamps, each.time_s[near], each.values[near]))
    return np.array(rows)
