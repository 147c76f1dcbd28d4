"""A flight at a glance: what was flown when, on the autopilot's clock."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection import Inspection
from flightid.inspection.actuators import find_actuators
from flightid.inspection.axes import axes_of
from flightid.inspection.saturation import limit_contacts
from flightid.inspection.signals import Signal, Span, find
from flightid.inspection.stamps import log_span
from flightid.logs import Log
from flightid.review.identity import ModeSpan, mode_spans

JOINED = 400.0
"""Contacts with a limit are drawn as one where less than this part of the flight lies between."""
MOST_BLOCKS = 400
SILENCE = 8.0
"""Steps of a stream without a sample that part its line."""


@dataclass(frozen=True, eq=False)
class TimelineLine:
    """One channel over the whole flight, as its extremes by column.

    Attributes
    ----------
    name, label, unit : str
        Canonical name, where it was logged, unit.
    low, high : ndarray, shape (n_columns,)
        Least and largest value in each column; NaN where the stream was silent.
    """

    name: str
    label: str
    unit: str
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@dataclass(frozen=True)
class TimelineBlock:
    """Something that lasted: a sweep, a mode, a contact with a limit.

    Attributes
    ----------
    kind, axis, text : str
        Kind as in `FoundExcitation`, or "mode", "limit", "air", "gap", "fall"; its axis, if any;
        words.
    start_s, stop_s : float
    """

    kind: str
    axis: str
    text: str
    start_s: float
    stop_s: float


@dataclass(frozen=True, eq=False)
class FlightTimeline:
    """What was flown when.

    Attributes
    ----------
    span_s : (float, float)
        First and last stamp of the log, s.
    lines : tuple of TimelineLine
        Throttle and body rates.
    blocks : tuple of TimelineBlock
        Modes, time in the air, excitation, contacts with limits, gaps.
    """

    span_s: Span
    lines: tuple[TimelineLine, ...]
    blocks: tuple[TimelineBlock, ...]


def flight_timeline(log: Log, inspection: Inspection, n_columns: int = 900) -> FlightTimeline:
    """Lay out a flight over time, from what its inspection has found.

    Parameters
    ----------
    log : Log
    inspection : Inspection
        Of that log.
    n_columns : int
        Columns of the lines.
    """
    span = log_span(log)
    wanted = [
        find(log, "thrust"),
        *(find(log, each.rate) for each in axes_of(log.vehicle).values()),
    ]
    lines = tuple(_line(each, span, n_columns) for each in wanted if each is not None)
    return FlightTimeline(span, lines, tuple(_blocks(log, inspection, span)))


def _line(signal: Signal, span: Span, n_columns: int) -> TimelineLine:
    edges = np.linspace(*span, n_columns + 1)
    index = np.searchsorted(signal.time_s, edges)
    index[-1] = signal.time_s.size
    filled = np.diff(index) > 0
    low, high = np.full(n_columns, np.nan), np.full(n_columns, np.nan)
    if np.any(filled):
        low[filled] = np.minimum.reduceat(signal.values, index[:-1][filled])
        high[filled] = np.maximum.reduceat(signal.values, index[:-1][filled])
    # A stream slower than the columns goes on between its samples, but not through a silence.
    centres = 0.5 * (edges[:-1] + edges[1:])
    before = np.clip(np.searchsorted(signal.time_s, centres) - 1, 0, signal.time_s.size - 2)
    steps = np.diff(signal.time_s)
    heard = (centres >= signal.time_s[0]) & (centres <= signal.time_s[-1])
    heard &= steps[before] <= SILENCE * float(np.median(steps))
    between = heard & ~filled
    low[between] = high[between] = signal.values[before[between]]
    return TimelineLine(signal.name, signal.label, signal.unit, low, high)


def _blocks(log: Log, inspection: Inspection, span: Span) -> list[TimelineBlock]:
    modes: tuple[ModeSpan, ...] = mode_spans(log)
    found = [TimelineBlock("mode", "", each.mode, each.start_s, each.stop_s) for each in modes]
    airborne = inspection.phases.airborne
    clipped = [(max(start, span[0]), min(stop, span[1])) for start, stop in airborne]
    found += [TimelineBlock("air", "", "in the air", *each) for each in clipped]
    found += [
        TimelineBlock(each.kind, each.axis, each.detail, each.start_s, each.stop_s)
        for each in inspection.excitations
    ]
    found += [TimelineBlock("gap", "", each.reason, each.start_s, each.stop_s) for each in log.gaps]
    if inspection.phases.tipped_s is not None:
        fell = inspection.phases.tipped_s
        found.append(TimelineBlock("fall", "", "the vehicle falls over", fell, span[1]))
    apart = (span[1] - span[0]) / JOINED
    limits = [
        TimelineBlock("limit", contact.axis, f"{contact.what} at its {contact.limit}", *each)
        for contact in limit_contacts(log, airborne, find_actuators(log))
        for each in contact.spans(apart)
    ]
    return [*found, *sorted(limits, key=lambda each: each.start_s - each.stop_s)[:MOST_BLOCKS]]
