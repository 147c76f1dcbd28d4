"""Signals of a log with their own stamps, in SI units, and records made from them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.inspection.sources import BY_KIND, Source
from flightid.logs import Log
from flightid.record import Record
from flightid.record.timebase import to_uniform
from flightid.units import conversion_factor

Span = tuple[float, float]
SI = {"deg/s": "rad/s", "deg": "rad"}


@dataclass(frozen=True, eq=False)
class Signal:
    """One quantity as logged, in SI units.

    Attributes
    ----------
    name : str
        Canonical name.
    time_s, values : ndarray, shape (n,)
        Stamps (increasing, s) and values.
    unit : str
        SI unit.
    source : Source
        Where it came from.
    """

    name: str
    time_s: NDArray[np.float64]
    values: NDArray[np.float64]
    unit: str
    source: Source

    @property
    def rate_hz(self) -> float:
        """Samples per second from the median interval; 0 below two samples."""
        steps = np.diff(self.time_s)
        return float(1.0 / np.median(steps)) if steps.size else 0.0

    def within(self, spans: Iterable[Span]) -> NDArray[np.float64]:
        """Values at stamps inside any of the spans."""
        return self.values[inside(self.time_s, spans)]


def inside(time_s: NDArray[np.float64], spans: Iterable[Span]) -> NDArray[np.bool_]:
    """Tell for each stamp whether it lies in any of the spans."""
    mask = np.zeros(time_s.shape, dtype=np.bool_)
    for start, stop in spans:
        mask |= (time_s >= start) & (time_s <= stop)
    return mask


def find(log: Log, name: str) -> Signal | None:
    """Take the best place of a signal that the log holds, or None.

    Stamps that repeat or go back are left out; `rates` counts them.
    """
    for source in BY_KIND[log.kind].get(name, ()):
        signal = read(log, name, source)
        if signal is not None:
            return signal
    return None


def places(log: Log, name: str) -> list[Signal]:
    """Every place of a signal that the log holds, best first."""
    found = (read(log, name, source) for source in BY_KIND[log.kind].get(name, ()))
    return [signal for signal in found if signal is not None]


def read(log: Log, name: str, source: Source) -> Signal | None:
    """Read one place of a signal; None where the log does not hold it or it does not run."""
    if source.message not in log or log.messages[source.message].rate_hz is None:
        return None
    info = log.messages[source.message]
    fields = [field for field in source.fields if field in info.fields]
    if not fields or fields[0] != source.fields[0]:
        return None
    table = log.table(source.message, info.instances[0] if info.instances else None)
    declared = table.unit(fields[0])
    unit = source.unit if declared == "1" else declared
    target = SI.get(unit, unit)
    scale = source.sign * conversion_factor(unit, target)
    values = scale * np.sum([table[field] for field in fields], axis=0)
    later = np.concatenate([[True], table.time_s[1:] > np.maximum.accumulate(table.time_s)[:-1]])
    good = later & np.isfinite(values)
    if np.count_nonzero(good) < 2:
        return None
    return Signal(name, table.time_s[good], values[good], target, source)


def records(signals: list[Signal], inputs: set[str], spans: Iterable[Span]) -> list[Record]:
    """Records of the spans at the rate of the slowest signal, cut at gaps."""
    slowest = min(signals, key=lambda signal: signal.rate_hz)
    made: list[Record] = []
    for span in spans:
        try:
            base = to_uniform(
                {signal.name: (signal.time_s, signal.values) for signal in signals},
                sample_time_s=1.0 / slowest.rate_hz,
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
