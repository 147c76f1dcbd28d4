"""Chirps that Betaflight adds to the set-point of a rate: where they are, by what it logs of them.

With ``debug_mode = CHIRP`` the first debug field holds the phase of the chirp, 5000 a radian, and
zero where there is none. It counts where the set-point of an axis moves with that very phase.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.axes import axes_of
from flightid.inspection.signals import Span, find
from flightid.inspection.stamps import believable
from flightid.logs import Log

Array = NDArray[np.float64]
PHASE = "debug[0]"
PHASE_SCALE = 5000.0
SHORTEST_S, PAUSE_S = 2.0, 0.25
LEAST_CYCLES = 8.0
PIECES = 24
"""Pieces of a chirp in each of which its gain and phase stand still."""
LEAST_SHARE = 0.6
"""Of the set-point's power that moves with the phase: sticks may move too."""
MOST_SLOPE = 2.5
"""Radians a sample that tell a phase: beyond, the log is too slow for it."""


@dataclass(frozen=True)
class FoundChirp:
    """A chirp in a log.

    Attributes
    ----------
    axis : str
    span_s : tuple of float
        First and last instant, s.
    low_hz, high_hz : float
        Lowest and highest frequency, Hz.
    size_deg_s : float
        Largest amplitude in the set-point, deg/s.
    """

    axis: str
    span_s: Span
    low_hz: float
    high_hz: float
    size_deg_s: float


def chirps(log: Log) -> tuple[FoundChirp, ...]:
    """Chirps of a blackbox log, in order; none of other logs.

    Reference
    ---------
    Betaflight, src/main/flight/pid.c and common/chirp.c (2025.12), DEBUG_CHIRP.
    """
    if log.kind != "betaflight" or "main" not in log or PHASE not in log.messages["main"].fields:
        return ()
    table = log.table("main")
    good = believable(table.time_s)
    time_s, phase = table.time_s[good], table[PHASE][good] / PHASE_SCALE
    if not (np.all(phase > -0.1) and np.all(phase < 2.0 * np.pi + 0.1)):
        return ()
    found = (_chirp(log, time_s, phase, rows) for rows in _active(time_s, phase))
    return tuple(each for each in found if each is not None)


def _active(time_s: Array, phase: Array) -> list[NDArray[np.intp]]:
    """Rows of each stretch with a phase, short zeros among them: it passes through zero."""
    rows = np.flatnonzero(phase)
    if rows.size < 2:
        return []
    parts = np.split(rows, np.flatnonzero(np.diff(time_s[rows]) > PAUSE_S) + 1)
    whole = (np.arange(part[0], part[-1] + 1) for part in parts)
    return [each for each in whole if time_s[each[-1]] - time_s[each[0]] >= SHORTEST_S]


def _chirp(log: Log, time_s: Array, phase: Array, rows: NDArray[np.intp]) -> FoundChirp | None:
    """The chirp of a stretch, on the axis whose set-point moves with its phase."""
    stamps, angle = time_s[rows], phase[rows]
    speed = np.mod(np.diff(angle), 2.0 * np.pi)
    tracked = speed < MOST_SLOPE
    # Beyond half the rate of the log its phase is no longer told.
    end = int(np.argmin(tracked)) if not tracked.all() else tracked.size
    if end < PIECES * 4 or speed[:end].sum() < 2.0 * np.pi * LEAST_CYCLES:
        return None
    stamps, angle, speed = stamps[: end + 1], angle[: end + 1], speed[:end]
    best, axis, size = LEAST_SHARE, "", 0.0
    for name, channels in axes_of(log.vehicle).items():
        signal = find(log, channels.set_point)
        if signal is None:
            continue
        share, most = _moved(np.interp(stamps, signal.time_s, signal.values), angle)
        if share > best:
            best, axis, size = share, name, most
    if not axis:
        return None
    rate = speed / np.diff(stamps) / (2.0 * np.pi)
    edge = max(1, end // 100)
    low, high = sorted(float(np.median(each)) for each in (rate[:edge], rate[-edge:]))
    span = float(stamps[0]), float(stamps[-1])
    return FoundChirp(axis, span, low, high, float(np.degrees(size)))


def _moved(values: Array, angle: Array) -> tuple[float, float]:
    """Share of a signal's power that moves with a phase, and the largest amplitude of that."""
    told, total, most = 0.0, 0.0, 0.0
    for part in np.array_split(np.arange(angle.size), PIECES):
        basis = np.column_stack([np.cos(angle[part]), np.sin(angle[part]), np.ones(part.size)])
        weights = np.linalg.lstsq(basis, values[part], rcond=None)[0]
        centred = values[part] - values[part].mean()
        moved = basis[:, :2] @ weights[:2]
        total += float(centred @ centred)
        told += float(centred @ (moved - moved.mean()))
        most = max(most, float(np.hypot(*weights[:2])))
    return (told / total if total > 0.0 else 0.0), most
