"""Whether what flew diverges: a rate or an angle that grows, unasked, until the end or a limit.

The error against the set-point (the signal itself where none is logged) has an envelope by windows.
A loop that is not stable makes it grow by the same factor in each window, over many times its size,
and leaves it there: sticks, gusts and landings do not. Windows of many lengths are tried, for how
fast it grows is not known.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.inspection.excitation_found import injected_spans
from flightid.inspection.signals import Signal, Span, find
from flightid.inspection.thresholds import DIVERGED_ANGLE, DIVERGED_RATE, GROWTH
from flightid.logs import Log

Array = NDArray[np.float64]
SHORTEST_S, LONGEST_S, ROWS_IN_WINDOW = 0.1, 6.4, 4
"""Shortest and longest window of an envelope, s, and rows that it holds at least."""
STEADY = 6
"""Windows in a row over which it grows."""
LEAST_RISE, LARGEST_RISE = 1.05, 8.0
"""Factors from window to window: less is no growth, more is a jump."""
STRAIGHT = 0.9
"""Share of the envelope's logarithm that a straight line explains."""
REACHED, STAYS = 0.7, 0.25
"""Shares of the largest envelope: where growth ends, and what it does not fall below after it."""
UNASKED = 2.0
"""Times the set-point's own moves in the same time."""
AXES = {"roll": ("p", "phi"), "pitch": ("q", "theta"), "yaw": ("r",)}


@dataclass(frozen=True)
class Divergence:
    """Growth of one signal until the end.

    Attributes
    ----------
    start_s, stop_s : float
        Where it grows, s on the clock of the stamps; behind `stop_s` it stays large.
    first, last : float
        Root mean square of the first and the last window of growth, in the signal's unit.
    time_constant_s : float
        Time in which it grows by e, s.
    frequency_hz : float or None
        Of the oscillation that grows; None where it grows to one side.
    at_limit_s : float
        How long it stays large after that, s; 0 where the flight ends in growth.
    """

    start_s: float
    stop_s: float
    first: float
    last: float
    time_constant_s: float
    frequency_hz: float | None
    at_limit_s: float


def divergence(time_s: Array, values: Array, asked: Array | None = None) -> Divergence | None:
    """Growth of a signal until the end of its samples; None where there is none.

    Parameters
    ----------
    time_s, values : ndarray, shape (n,)
        Increasing stamps, s, and the signal, in any unit.
    asked : ndarray, shape (n,), optional
        Its set-point.

    Example
    -------
    >>> time_s = np.arange(0.0, 20.0, 0.01)
    >>> values = np.sin(20.0 * time_s) * np.maximum(0.02, np.exp((time_s - 20.0) / 0.8))
    >>> found = divergence(time_s, values)
    >>> round(found.time_constant_s, 1), round(found.frequency_hz)
    (0.8, 3)
    >>> divergence(time_s, np.sin(20.0 * time_s)) is None
    True
    """
    error = values - np.median(values) if asked is None else values - asked
    span_s = float(time_s[-1] - time_s[0])
    tick_s = span_s / max(1, time_s.size - 1)
    window_s = max(SHORTEST_S, ROWS_IN_WINDOW * tick_s)
    while window_s <= min(LONGEST_S, span_s / (STEADY + 2)):
        found = _grown(time_s, error, window_s)
        if found is not None and _is_unasked(found, time_s, values, asked):
            return found
        window_s *= float(np.sqrt(2.0))
    return None


def _grown(time_s: Array, error: Array, window_s: float) -> Divergence | None:
    """Growth by windows of one length, counted from the end."""
    place = ((time_s[-1] - time_s) / window_s).astype(int)
    count = place[0]  # The oldest window is cut short, and left out.
    kept = place < count
    power = np.bincount(place[kept], error[kept] ** 2, count)
    rows = np.bincount(place[kept], minlength=count)
    if count < STEADY + 2 or np.any(rows < 2):
        return None
    envelope = np.sqrt(power / rows)[::-1]
    top = int(np.argmax(envelope >= REACHED * envelope.max()))
    if top < STEADY or np.any(envelope[top:] < STAYS * envelope.max()) or envelope.min() <= 0.0:
        return None
    rise = envelope[1 : top + 1] / envelope[:top]
    steady = (rise >= LEAST_RISE) & (rise <= LARGEST_RISE)
    falters = np.flatnonzero(~steady)
    first = int(falters[-1]) + 1 if falters.size else 0
    if top - first < STEADY or envelope[top] < GROWTH.value * envelope[first]:
        return None
    # What came before was small: the flight had no such amplitude until then.
    if np.any(envelope[: first + 1] > REACHED * envelope[top]):
        return None
    rows_of = np.arange(first, top + 1)
    height = np.log(envelope[first : top + 1])
    slope, level = np.polyfit(rows_of * window_s, height, 1)
    left = height - (slope * rows_of * window_s + level)
    if np.var(left) > (1.0 - STRAIGHT) * np.var(height):
        return None
    start_s = float(time_s[-1] - (count - first) * window_s)
    stop_s = float(time_s[-1] - (count - 1 - top) * window_s)
    # Early turns are those of noise: those of what has grown are counted.
    grown_s = stop_s - (stop_s - start_s) / 3.0
    inside = (time_s >= grown_s) & (time_s <= stop_s)
    turns = int(np.count_nonzero(np.diff(np.signbit(error[inside]))))
    hertz = 0.5 * turns / (stop_s - grown_s) if turns > 3 else None
    return Divergence(
        start_s,
        stop_s,
        float(envelope[first]),
        float(envelope[top]),
        float(1.0 / slope),
        hertz,
        float(time_s[-1]) - stop_s,
    )


def _is_unasked(found: Divergence, time_s: Array, values: Array, asked: Array | None) -> bool:
    if asked is None:
        return True
    late = time_s >= found.stop_s - (found.stop_s - found.start_s) / 3.0
    return float(np.std(values[late])) > UNASKED * float(np.std(asked[late]))


def divergence_findings(log: Log, airborne: Iterable[Span]) -> list[Finding]:
    """What diverges until the end of the flight, axis by axis, and what to do about it.

    Parameters
    ----------
    log : Log
    airborne : iterable of (float, float)
        Spans in the air, s; the last is looked at.
    """
    spans = tuple(airborne)
    if not spans:
        return []
    start_s, stop_s = spans[-1]
    # Sweeps that are injected make outputs grow with their frequency.
    start_s = max([start_s, *(min(stop, stop_s) for _, stop in injected_spans(log))])
    found = []
    for axis, names in AXES.items():
        for name in names:
            signal = find(log, name)
            if signal is None:
                continue
            told = _of_signal(signal, find(log, f"{name}_ref"), (start_s, stop_s))
            if told is not None:
                found.append(_finding(axis, name in ("p", "q", "r"), told))
                break
    return found


def _of_signal(signal: Signal, asked: Signal | None, span: Span) -> Divergence | None:
    inside = (signal.time_s >= span[0]) & (signal.time_s <= span[1])
    time_s, values = signal.time_s[inside], signal.values[inside]
    if time_s.size < ROWS_IN_WINDOW * STEADY:
        return None
    told = None if asked is None else np.interp(time_s, asked.time_s, asked.values)
    found = divergence(time_s, values, told)
    least = DIVERGED_RATE if signal.unit == "rad/s" else DIVERGED_ANGLE
    return found if found is not None and found.last >= least.value else None


def _finding(axis: str, is_rate: bool, found: Divergence) -> Finding:
    what, unit = (f"{axis} rate", "deg/s") if is_rate else (f"{axis} angle", "deg")
    sizes = f"{np.degrees(found.first):.3g} to {np.degrees(found.last):.3g} {unit} rms"
    hertz = found.frequency_hz
    how = "to one side" if hertz is None else f"as an oscillation of {hertz:.2g} Hz"
    end = "and the flight ends so"
    if found.at_limit_s > found.time_constant_s:
        end = "and stays there until the flight ends"
    message = (
        f"{what} diverges: its error grows {how} from {sizes} between {found.start_s:.1f} and "
        f"{found.stop_s:.1f} s, by e in {found.time_constant_s:.2g} s, unasked, {end}"
    )
    cause = (
        "look for motors or propellers that are swapped or turn the wrong way, a sensor's "
        "orientation, a trim at its limit"
        if hertz is None
        else f"halve P, I and D of {axis}, or go back to the gains that last flew well"
    )
    action = f"do not fly these settings again: {cause}; then fly a hover and hand in its log"
    return Finding(f"diverges-{axis}", Light.AMBER, message, action)
