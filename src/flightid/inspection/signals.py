"""Signals of a log with their own stamps, and records made from them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, MissingColumnError, UnitError, UnknownNameError
from flightid.frozen import dataclass
from flightid.inspection.stamps import believable
from flightid.logs import Log
from flightid.logs.channels.channel_map import DEFAULTS, ChannelMap, channel_map, default_map
from flightid.logs.extraction import extract
from flightid.record import Record
from flightid.record.timebase import to_uniform

Span = tuple[float, float]
FALLBACK = {kind: name for (kind, _), name in reversed(DEFAULTS.items())}
"""Map for a log that does not tell its vehicle: the first of its kind."""


@dataclass(frozen=True, eq=False)
class Signal:
    """One channel as logged.

    Attributes
    ----------
    name : str
        Canonical name.
    time_s, values : ndarray, shape (n,)
        Stamps (increasing, s) and values.
    unit : str
        Unit of the channel map (SI).
    label : str
        Where it came from, in the log's own names.
    """

    name: str
    time_s: NDArray[np.float64]
    values: NDArray[np.float64]
    unit: str
    label: str

    @cached_property
    def rate_hz(self) -> float:
        """Samples per second from the median interval."""
        return float(1.0 / np.median(np.diff(self.time_s), overwrite_input=True))

    def within(self, spans: Iterable[Span]) -> NDArray[np.float64]:
        """Values at stamps inside any of the spans."""
        return self.values[place_of(self.time_s, spans)]


def inside(time_s: NDArray[np.float64], spans: Iterable[Span]) -> NDArray[np.bool_]:
    """Tell for each stamp whether it lies in any of the spans."""
    mask = np.zeros(time_s.shape, dtype=np.bool_)
    for start, stop in spans:
        mask |= (time_s >= start) & (time_s <= stop)
    return mask


def place_of(time_s: NDArray[np.float64], spans: Iterable[Span]) -> slice | NDArray[np.bool_]:
    """Place of the increasing stamps inside any of the spans: of one span without a copy."""
    spans = tuple(spans)
    if len(spans) != 1:
        return inside(time_s, spans)
    ((start, stop),) = spans
    first = np.searchsorted(time_s, start, side="left")
    return slice(int(first), int(np.searchsorted(time_s, stop, side="right")))


def map_of(log: Log) -> ChannelMap:
    """The shipped map of a log, one of its kind where it does not tell its vehicle."""
    try:
        return default_map(log.kind, log.vehicle)
    except DataError:
        return channel_map(FALLBACK[log.kind])


def find(log: Log, name: str) -> Signal | None:
    """Take the best place of a channel that the log holds, or None.

    Stamps that cannot be believed are left out; `rates` counts them.
    """
    return next(iter(places(log, name, most=1)), None)


def places(log: Log, name: str, most: int | None = None) -> list[Signal]:
    """Places of a channel that the log holds, best first."""
    try:
        channel = map_of(log)[name]
    except UnknownNameError:
        return []
    found: list[Signal] = []
    for source in channel.sources:
        info = log.messages.get(source.message)
        if info is None or info.rate_hz is None or len(found) == most:
            continue
        try:
            samples = extract(log, replace(channel, sources=(source,)))
        except (MissingColumnError, UnitError):
            continue
        good = believable(samples.time_s) & np.isfinite(samples.values)
        if np.count_nonzero(good) >= 2:
            stamps, values = samples.time_s, samples.values
            if not np.all(good):
                stamps, values = stamps[good], values[good]
            found.append(Signal(name, stamps, values, channel.unit, str(source)))
    return found


def records(
    signals: list[Signal],
    inputs: set[str],
    spans: Iterable[Span],
    sample_time_s: float | None = None,
) -> list[Record]:
    """Records of the spans at the rate of the slowest signal, or at one given, cut at gaps.

    A span comes from one stream and ends with it; each part of it that all signals cover is taken.
    """
    step_s = sample_time_s or 1.0 / min(signal.rate_hz for signal in signals)
    begin = max(float(signal.time_s[0]) for signal in signals)
    end = min(float(signal.time_s[-1]) for signal in signals)
    made: list[Record] = []
    for span in ((max(start, begin), min(stop, end)) for start, stop in spans):
        try:
            base = to_uniform(
                {signal.name: (signal.time_s, signal.values) for signal in signals},
                sample_time_s=step_s,
                span_s=span,
                gaps="split",
            )
        except DataError:
            # A span without common samples gives no record; what is missing shows in the rates.
            continue
        for part in base.spans:
            groups: dict[bool, dict[str, NDArray[np.float64]]] = {True: {}, False: {}}
            for signal in signals:
                groups[signal.name in inputs][signal.name] = part.samples[signal.name]
            made.append(
                Record.from_arrays(
                    part.time_s,
                    inputs=groups[True],
                    outputs=groups[False],
                    units={signal.name: signal.unit for signal in signals},
                )
            )
    return made
