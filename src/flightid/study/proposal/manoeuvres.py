"""Stretches of ordinary flying that move an axis enough to verify a model on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.inspection.axes import axes_of
from flightid.inspection.signals import Signal, Span, find, inside
from flightid.logs import Log

LENGTH_S, STEP_S = 8.0, 0.5
"""Length of a stretch: a doublet with its answer; distance of those that are tried, s."""
LEAST = 0.2
"""Least root mean square of the command, of that in the sweep: less would tell noise."""


def liveliest(
    log: Log, axis: str, spans: Iterable[Span], avoid: Sequence[Span], swept: Sequence[Span]
) -> tuple[Span, ...]:
    """The stretch in which an axis was commanded most, apart from what fits see; or none.

    Parameters
    ----------
    log : Log
    axis : str
    spans : iterable of Span
        In the air, s.
    avoid : sequence of Span
        Injections, s.
    swept : sequence of Span
        Those of this axis: the measure of what is enough.
    """
    names = axes_of(log.vehicle)[axis]
    command, rate = find(log, names.command), find(log, names.rate)
    if command is None or rate is None:
        return ()
    enough = LEAST * _deviation(command.within(swept))
    best: tuple[float, Span] | None = None
    for start, stop in spans:
        for begin in np.arange(start, stop - LENGTH_S, STEP_S):
            span = (float(begin), float(begin) + LENGTH_S)
            if any(a < span[1] and b > span[0] for a, b in avoid) or not _whole(rate, span):
                continue
            strength = _strength(command, span)
            if strength >= enough and (best is None or strength > best[0]):
                best = (strength, span)
    return () if best is None else (best[1],)


def _strength(command: Signal, span: Span) -> float:
    """Root mean square of the command's departures, those in the middle counted most."""
    mask = inside(command.time_s, [span])
    values = command.values[mask]
    if values.size < 8:
        return 0.0
    weights = np.hanning(values.size + 2)[1:-1]
    departures = values - np.median(values)
    return float(np.sqrt(np.average(np.square(departures), weights=weights)))


def _whole(rate: Signal, span: Span) -> bool:
    """Whether the motion was logged all along, without a gap of three samples."""
    stamps = rate.time_s[inside(rate.time_s, [span])]
    edges = np.concatenate([[span[0]], stamps, [span[1]]])
    return bool(np.max(np.diff(edges)) < 3.0 / rate.rate_hz)


def _deviation(values: NDArray[np.float64]) -> float:
    return float(np.std(values)) if values.size else 0.0
