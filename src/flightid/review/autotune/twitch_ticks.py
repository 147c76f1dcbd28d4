"""Stamps of a loop that logs each of its ticks: what they scatter by is not when it ran."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.inspection.signals import Signal, Span, inside

Array = NDArray[np.float64]


def on_ticks(
    signals: tuple[Signal, Signal], spans: Sequence[Span], past_s: float
) -> tuple[tuple[Signal, Signal], list[Span]]:
    """Signals of one table on even stamps within spans, of one tick for all of them.

    Interpolation between stamps that scatter would move samples that the loop took at its ticks,
    and each span would have a sample time of its own. Signals with stamps of their own stay.

    Parameters
    ----------
    signals : tuple of Signal
    spans : sequence of tuple of float
        Seconds.
    past_s : float
        Seconds before a span that are on its ticks too, where they are logged.

    Returns
    -------
    tuple of Signal
    list of tuple of float
        The spans, from their first to their last tick.
    """
    stamps = signals[0].time_s
    if not np.array_equal(stamps, signals[1].time_s):
        return signals, list(spans)
    rows = [np.flatnonzero(inside(stamps, [span])) for span in spans]
    steps = np.concatenate([np.diff(stamps[row]) for row in rows] or [np.zeros(0)])
    if not steps.size:
        return signals, list(spans)
    tick = _tick(stamps, rows, float(np.median(steps)))
    moved, found = stamps.copy(), []
    for span, row in zip(spans, rows, strict=True):
        if row.size < 2:
            found.append(span)
            continue
        wide = np.flatnonzero(inside(stamps, [(span[0] - past_s, span[1])]))
        counts = np.round((stamps[wide] - stamps[row[0]]) / tick)
        if np.any(np.diff(counts) < 1.0):
            found.append(span)
            continue
        first = float(np.mean((stamps[wide] - tick * counts)[counts >= 0.0]))
        moved[wide] = first + tick * counts
        found.append((float(moved[row[0]]), float(moved[row[-1]])))
    if np.any(np.diff(moved) <= 0.0):
        return signals, list(spans)
    return (replace(signals[0], time_s=moved), replace(signals[1], time_s=moved)), found


def _tick(stamps: Array, rows: Sequence[NDArray[np.int64]], about: float) -> float:
    """Seconds a tick, from the first and the last of each span."""
    lengths = np.array([stamps[row[-1]] - stamps[row[0]] for row in rows if row.size > 1])
    return float(lengths.sum() / np.round(lengths / about).sum())
