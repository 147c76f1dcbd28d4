"""What a record refuses: stamps that are not uniform, samples that are not finite or do not fit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Role
from flightid.errors import DataError, OptionError, ShapeError, UnknownNameError
from flightid.record.channel import Channel
from flightid.record.stamps import (
    SLOWEST_S,
    UNIFORM_TOLERANCE,
    finer_unit,
    rounded_step_s,
)
from flightid.units import DIMENSIONLESS

REPEATING = 0.5
"""Least correlation of inputs a declared period apart."""
FEWEST_COMPARED = 8
"""Samples beyond the first period below which a record tells nothing of it."""
LARGEST, SMALLEST = 1e75, 1e-75
"""Of a channel's largest sample, and of a sample time: beyond, fourth powers are no numbers."""
AT_ONCE = 1 << 14
"""Stamps that are compared at once."""
TIME = "time_s"
"""Name of the time dimension and coordinate of a record."""


def own_samples(
    channel: Channel, samples: ArrayLike, time_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Samples of a channel, copied; refused where they do not fit."""
    if channel.name == TIME:
        raise DataError(
            "a channel has the name of the time base", found=TIME, needed="another name"
        )
    values = np.array(samples, dtype=np.float64)
    if values.shape != time_s.shape or time_s.ndim != 1:
        raise ShapeError(
            f"channel {channel.name!r} does not fit the time base",
            found=f"shape {values.shape}",
            needed=f"shape {time_s.shape}, one-dimensional",
        )
    return values


def labelled_samples(
    groups: Mapping[Role, Mapping[str, ArrayLike]],
    time_s: NDArray[np.float64],
    units: Mapping[str, str],
    notes: Mapping[str, str],
    trim: Mapping[str, float],
) -> dict[Channel, NDArray[np.float64]]:
    """Samples by channel; refused where a channel has two roles or a label no channel."""
    found: dict[str, tuple[Channel, NDArray[np.float64]]] = {}
    for role, group in groups.items():
        for key, samples in group.items():
            if key in found:
                raise OptionError(
                    "a channel is named twice", found=key, needed="one role for each channel"
                )
            channel = Channel(key, units.get(key, DIMENSIONLESS), role, notes.get(key, ""))
            found[key] = channel, own_samples(channel, samples, time_s)
    for label in (*units, *trim, *notes):
        if label not in found:
            raise unknown_channel(label, found)
    return dict(found.values())


def inside_span(
    time_s: NDArray[np.float64], start_s: float, stop_s: float, sample_time_s: float
) -> NDArray[np.bool_]:
    """Stamps with ``start_s <= time < stop_s``; refused where there are fewer than two."""
    slack = sample_time_s * UNIFORM_TOLERANCE
    inside = (time_s >= start_s - slack) & (time_s < stop_s - slack)
    if np.count_nonzero(inside) < 2:
        raise DataError(
            "the segment holds fewer than two samples",
            found=f"{start_s} s to {stop_s} s",
            needed=f"a span inside {time_s[0]:.3f} s to {time_s[-1]:.3f} s",
        )
    return np.asarray(inside)


def unknown_channel(name: str, channels: Iterable[str]) -> UnknownNameError:
    """The error for a channel that is not there; lists those that are."""
    return UnknownNameError(
        "there is no such channel", found=name, needed="one of " + ", ".join(channels)
    )


def require_finite(name: str, samples: NDArray[np.float64]) -> None:
    """Refuse samples that are not finite."""
    bad = np.flatnonzero(~np.isfinite(samples))
    if bad.size:
        raise DataError(
            f"channel {name!r} holds samples that are not finite",
            found=f"{bad.size} of {samples.size}, the first at index {bad[0]}",
            needed="finite numbers",
            action="cut the segment, or fill gaps with a stated policy when resampling",
        )


def require_period(
    inputs: Iterable[NDArray[np.float64]], sample_time_s: float, period_s: float | None
) -> None:
    """Refuse a declared period after which no input is like itself.

    A half of the variance may differ: measured inputs carry noise. Records shorter than one and a
    half periods tell nothing.

    Raises
    ------
    DataError
        The inputs a period apart are hardly correlated.

    Example
    -------
    >>> u = np.sin(2 * np.pi * np.arange(300) / 100)
    >>> require_period([u], 0.01, 1.0)
    """
    if period_s is None:
        return
    lag, alike = max(1, round(period_s / sample_time_s)), []
    for samples in inputs:
        compared, spread = samples.size - lag, float(np.var(samples))
        if compared >= max(FEWEST_COMPARED, lag / 2) and spread > 0.0:
            apart = float(np.mean((samples[lag:] - samples[:-lag]) ** 2))
            alike.append(1.0 - apart / (2.0 * spread))
    if alike and max(alike) < REPEATING:
        raise DataError(
            "the inputs do not repeat after the declared period",
            found=f"correlation {max(alike):.2g} of inputs {period_s:g} s apart",
            needed=f"at least {REPEATING:g}",
            action="declare period_s as it was flown, or leave it out",
        )


def _farthest(time_s: NDArray[np.float64], sample_time_s: float) -> float:
    """Longest way of a stamp from its place on the grid, s."""
    far, count = 0.0, np.arange(min(AT_ONCE, time_s.size), dtype=np.float64)
    # Spans that stay in the cache: long records are made several times on their way, and each asks.
    for first in range(0, time_s.size, AT_ONCE):
        stamps = time_s[first : first + AT_ONCE]
        away = count[: stamps.size] + first
        away *= sample_time_s
        away += time_s[0]
        away -= stamps
        far = max(far, float(away.max()), -float(away.min()))
    return far


def uniform_sample_time(time_s: NDArray[np.float64]) -> float:
    """Sample time of uniform stamps, s; refused where they are not uniform."""
    if time_s.ndim != 1 or time_s.size < 2:
        raise DataError("a record needs a time base", found=f"{time_s.size} stamps", needed="2")
    if not np.all(np.isfinite(time_s)):
        raise DataError("time stamps are not finite", needed="finite stamps in seconds")
    sample_time_s = float(time_s[-1] - time_s[0]) / (time_s.size - 1)
    if sample_time_s <= 0:
        raise DataError("time stamps do not increase", needed="increasing stamps in seconds")
    if not SMALLEST <= sample_time_s <= LARGEST:
        raise DataError(
            "the sample time is no time of a flight",
            found=f"{sample_time_s:.3g} s",
            needed=f"{SMALLEST:g} s to {LARGEST:g} s",
            action="look whether the time column is what it is taken for, and in which unit",
        )
    worst = _farthest(time_s, sample_time_s) / sample_time_s
    if worst > UNIFORM_TOLERANCE:
        step = rounded_step_s(time_s)
        raise DataError(
            "time stamps are not uniform",
            found=f"a stamp {100 * worst:.3g} % of a sample time off the grid",
            needed=f"at most {100 * UNIFORM_TOLERANCE:g} %",
            action="bring the channels to one time base where they are read, "
            f"{_one_base(step)}, or by conditioning.to_uniform in Python",
        )
    return sample_time_s


def _one_base(step_s: float) -> str:
    """The option that brings stamps so far apart to one base; seconds are rare, and asked about."""
    as_they_are = f"resample_to_s={f'{step_s:.9g}' if step_s > 0 else '…'}"
    if step_s < SLOWEST_S:
        return as_they_are
    unit, length_s = finer_unit(step_s)
    finer = f"resample_to_s={step_s * length_s:.9g} time_unit={unit!r}"
    rare = f"where stamps are in {unit} ({step_s:.6g} s between rows are rare)"
    return f"{finer} {rare}, else {as_they_are}"
