"""Instants at which held inputs may step: the grid of a record belongs on them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.record.interpolation import is_coarser, slack_s
from flightid.record.stamps import StampedSamples, mean_spacing_s

Array = NDArray[np.float64]
Signal = tuple[Array, Array]
"""Stamps, s, and samples, shape (n,) each."""
FEWEST_STEPS = 8
"""Steps of an input that is logged faster than the grid, to say that they lie on it."""
SHARED_PHASE = 0.97
"""Mean resultant of their phases on the grid from which they do: a spread of 4 % of its step."""
LATEST = 0.99
"""Share of the instants that the grid waits for."""
MOST_WALK = 0.25
"""Part of a step that the clock of a channel may walk off its median spacing over a record."""


def clock_step_s(time_s: Array) -> float:
    """Spacing of a channel's clock, s: the median's, unless the clock walks off it.

    Example
    -------
    >>> clock_step_s(0.02 * np.arange(100)), clock_step_s(0.0201 * np.arange(1000).round())
    (0.02, 0.0201)
    """
    spacing = np.diff(time_s)
    median = float(np.median(spacing))
    counts = np.maximum(np.rint(spacing / median), 1.0) if median > 0 else np.ones_like(spacing)
    mean = float(np.sum(spacing) / np.sum(counts))
    walks = median <= 0 or abs(mean / median - 1.0) * float(np.sum(counts)) > MOST_WALK
    return float(f"{mean if walks else median:.9g}")


def moves_on(signal: Signal, step_s: float) -> bool:
    """Whether a held input that is logged faster than a grid steps once in its step alone.

    Example
    -------
    >>> time_s, held = 0.005 * np.arange(400), np.repeat(np.tile([0.0, 1.0], 50), 4)
    >>> moves_on((time_s, held), 0.02), moves_on((time_s, held), 0.03)
    (True, False)
    """
    if not is_coarser(step_s, mean_spacing_s(signal[0])):
        return False
    steps = _instants(signal, step_s)
    return steps.size >= FEWEST_STEPS and _phase(steps, step_s)[1] >= SHARED_PHASE


def span_of_steps(
    rows: Mapping[str, Signal], held: Iterable[str], step_s: float
) -> tuple[float, float] | None:
    """First and last instant that all channels cover, s, the first where held inputs step.

    None where there are no held inputs or their instants share no phase of the grid.
    """
    start = max(float(time_s[0]) for time_s, _ in rows.values())
    stop = min(float(time_s[-1]) for time_s, _ in rows.values())
    latest = []
    for name in held:
        time_s, values = rows[name]
        steps = _instants(rows[name], step_s)
        if not steps.size:
            continue
        middle, resultant = _phase(steps, step_s)
        if resultant < SHARED_PHASE**4:
            return None
        late = (steps / step_s - middle + 0.5) % 1.0 - 0.5
        slack = slack_s(StampedSamples(name, time_s, values), step_s) / step_s
        latest.append(middle + max(0.0, float(np.quantile(late, LATEST)) - slack))
    if not latest:
        return None
    after = (latest[0] - start / step_s) % 1.0
    start += step_s * (after if after < 1.0 - 1e-6 else 0.0)
    return (start, stop) if start < stop else None


def _instants(signal: Signal, step_s: float) -> Array:
    """Where an input may step: at its stamps, or where it did if it is logged faster."""
    time_s, values = signal
    if not is_coarser(step_s, mean_spacing_s(time_s)):
        return time_s
    return np.asarray(time_s[1:][np.diff(values) != 0], dtype=np.float64)


def _phase(instants: Array, step_s: float) -> tuple[float, float]:
    """Mean phase on a grid through zero, in steps, and how much the instants agree on it."""
    mean = complex(np.mean(np.exp(2j * np.pi * (instants / step_s % 1.0))))
    return float(np.angle(mean)) / (2 * np.pi), abs(mean)
