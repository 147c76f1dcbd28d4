"""What a flight told of its axes, kept while its log is held: no wish of a plan changes it."""

from __future__ import annotations

from weakref import WeakKeyDictionary

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.inspection.signals import Span
from flightid.logs import Log
from flightid.planning.axis_guess import AxisGuess, guess_axis
from flightid.planning.flown_axis import Entry

Question = tuple[str, AxisLoop, str, Entry, tuple[Span, ...]]

_TOLD: WeakKeyDictionary[Log, list[tuple[Question, AxisGuess]]] = WeakKeyDictionary()


def told_axis(
    axis: str, loop: AxisLoop, kind: str, enters: Entry, log: Log | None, spans: tuple[Span, ...]
) -> AxisGuess:
    """`guess_axis`, worked out once for each log that is held and its controllers.

    Amplitude, band, length and number of sweeps rest on the axis and not the axis on them: a plan
    with another of them takes a thirtieth of the first one's time.
    """
    if log is None:
        return guess_axis(axis, loop, kind, enters, log, spans)
    kept = _TOLD.setdefault(log, [])
    asked = (axis, loop, kind, enters, spans)
    for earlier, guess in kept:
        if earlier == asked:
            return guess
    made = guess_axis(axis, loop, kind, enters, log, spans)
    kept.append((asked, made))
    return made
