"""A flight as records of bounded length, made when they are asked for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.signals import Signal, Span, records
from flightid.inspection.thresholds import LONGEST_WINDOW
from flightid.record import Record

WINDOWS = 8
"""Longest windows in a stretch."""
MARGIN_S = 2.0
"""What the low-pass of a faster signal reads beyond a stretch, s, at least."""
MARGIN_STEPS = 64
"""And steps of the stretch."""


@dataclass(frozen=True, eq=False)
class FlightStretches:
    """Records of all signals, cut at gaps and after eight of the longest windows.

    Attributes
    ----------
    signals : tuple of Signal
    inputs : frozenset of str
        Names of the signals that are inputs.
    spans : tuple of (float, float)
        What to cut, s.
    """

    signals: tuple[Signal, ...]
    inputs: frozenset[str]
    spans: tuple[Span, ...]

    @cached_property
    def step_s(self) -> float:
        """Sample time of the slowest signal: that of all records, s."""
        return 1.0 / min(signal.rate_hz for signal in self.signals)

    @property
    def are_long(self) -> bool:
        """Whether any span is cut for its length alone."""
        return self.n_parts > len(self.spans)

    @property
    def n_parts(self) -> int:
        """Parts that are made of the spans before gaps are looked at."""
        return sum(self._count(start, stop) for start, stop in self._covered())

    def __iter__(self) -> Iterator[Record]:
        margin_s = max(MARGIN_S, MARGIN_STEPS * self.step_s)
        for start, stop in self._covered():
            edges = np.linspace(start, stop, self._count(start, stop) + 1).tolist()
            for part in pairwise(edges):
                around = (part[0] - margin_s, part[1] + margin_s)
                near = [_clipped(signal, around) for signal in self.signals]
                if all(signal.time_s.size > 1 for signal in near):
                    yield from records(near, set(self.inputs), [part], self.step_s)

    def _covered(self) -> Iterator[Span]:
        """What all signals cover of each span: empty, stop before start, where they do not."""
        begin = max(float(signal.time_s[0]) for signal in self.signals)
        end = min(float(signal.time_s[-1]) for signal in self.signals)
        return ((max(start, begin), min(stop, end)) for start, stop in self.spans)

    @staticmethod
    def _count(start_s: float, stop_s: float) -> int:
        return max(1, math.ceil((stop_s - start_s) / (WINDOWS * LONGEST_WINDOW.value)))


def _clipped(signal: Signal, span: Span) -> Signal:
    """The part of a signal inside a span: a view, and in double precision."""
    first, last = np.searchsorted(signal.time_s, span)
    part = slice(int(first), int(last))
    return replace(
        signal,
        time_s=signal.time_s[part],
        values=np.asarray(signal.values[part], dtype=np.float64),
    )


def packed(signals: Iterable[Signal]) -> tuple[Signal, ...]:
    """The same signals in less memory: stamps held once, single precision where that is exact."""
    held: list[Signal] = []
    for signal in signals:
        short = signal.values.astype(np.float32)
        values: NDArray[Any] = short if np.array_equal(short, signal.values) else signal.values
        same = (each.time_s for each in held if np.array_equal(each.time_s, signal.time_s))
        held.append(replace(signal, time_s=next(same, signal.time_s), values=values))
    return tuple(held)
