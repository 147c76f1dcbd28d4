"""Chirps that a firmware adds to the set-point of a rate: where they are, by what it logs of them.

With ``debug_mode = CHIRP`` Betaflight's first debug field holds the phase of the chirp, 5000 a
radian, and zero where there is none; INAV's fields hold its state, its axis, and hundredths of what
it adds and of its frequency. It counts where the set-point of an axis moves with it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.axes import axes_of
from flightid.inspection.signals import Signal, Span, find
from flightid.inspection.stamps import believable
from flightid.logs import Log
from flightid.logs.blackbox.firmware import BETAFLIGHT, INAV

Array = NDArray[np.float64]
PHASE = "debug[0]"
PHASE_SCALE = 5000.0
"""Counts of the logged phase to a radian."""
BESIDE = 0.1
"""Beyond a turn, rad, from which the numbers are no phase."""
SHORTEST_S, PAUSE_S = 2.0, 0.25
"""Shortest chirp, s, and the pause that ends one."""
LEAST_CYCLES = 8.0
"""Cycles of the phase without which it is no chirp."""
PIECES = 24
"""Pieces of a chirp in each of which its gain and phase stand still."""
LEAST_SHARE = 0.6
"""Of the set-point's power that moves with the phase: sticks may move too."""
INAV_FIELDS = tuple(f"debug[{place}]" for place in range(4))
RUNNING = 3
"""INAV's number of the state in which the chirp runs."""
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
    Betaflight, src/main/flight/pid.c and common/chirp.c (2025.12), DEBUG_CHIRP; INAV,
    flight/chirp_flight.c (in development in 2026).
    """
    if log.kind == INAV:
        return tuple(_inav_chirps(log))
    if log.kind != BETAFLIGHT or "main" not in log or PHASE not in log.messages["main"].fields:
        return ()
    table = log.table("main")
    good = believable(table.time_s)
    time_s, phase = table.time_s[good], table[PHASE][good] / PHASE_SCALE
    if not (np.all(phase > -BESIDE) and np.all(phase < 2.0 * np.pi + BESIDE)):
        return ()
    found = (_chirp(log, time_s, phase, rows) for rows in _active(time_s, phase))
    return tuple(each for each in found if each is not None)


def _inav_chirps(log: Log) -> Iterator[FoundChirp]:
    if "main" not in log or not {*INAV_FIELDS} <= {*log.messages["main"].fields}:
        return
    table = log.table("main")
    good = believable(table.time_s)
    state, axis, added, hertz = (table[name][good] for name in INAV_FIELDS)
    time_s = table.time_s[good]
    for rows in _active(time_s, np.where(state == RUNNING, added, 0.0)):
        names = [
            name for place, name in enumerate(axes_of(log.vehicle), 1) if place == axis[rows[0]]
        ]
        told, cycles = hertz[rows] / 100.0, np.diff(np.sign(added[rows]), prepend=0.0)
        if not names or np.count_nonzero(cycles) < 2.0 * LEAST_CYCLES:
            continue
        signal = find(log, axes_of(log.vehicle)[names[0]].set_point)
        if signal is None or _share_of(signal, time_s[rows], added[rows]) < LEAST_SHARE:
            continue
        span = float(time_s[rows[0]]), float(time_s[rows[-1]])
        low, high = (float(told[told > 0.0].min(initial=np.inf)), float(told.max()))
        yield FoundChirp(names[0], span, low, high, float(np.abs(added[rows]).max()) / 100.0)


def _share_of(signal: Signal, stamps: Array, added: Array) -> float:
    """Share of a signal's power that moves with what was added, slow moves of sticks aside."""
    values = np.interp(stamps, signal.time_s, signal.values)
    told = total = 0.0
    for part in np.array_split(np.arange(stamps.size), PIECES):
        moved, wave = values[part] - values[part].mean(), added[part] - added[part].mean()
        power = float(wave @ wave)
        told += float(moved @ wave) ** 2 / power if power > 0.0 else 0.0
        total += float(moved @ moved)
    return told / total if total > 0.0 else 0.0


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
