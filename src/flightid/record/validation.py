"""What a record refuses: stamps that are not uniform, samples that are not finite or do not fit."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, ShapeError, UnknownNameError
from flightid.record.channel import Channel
from flightid.record.stamps import UNIFORM_TOLERANCE

TIME = "time_s"
"""Name of the time dimension and coordinate of a record."""

Variable = tuple[tuple[str], NDArray[np.float64], dict[str, str]]


def labelled_variable(
    channel: Channel, samples: ArrayLike, time_s: NDArray[np.float64]
) -> Variable:
    """Samples of a channel as an xarray variable, copied; refused where they do not fit."""
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
    attributes = {"unit": channel.unit, "role": str(channel.role), "note": channel.note}
    return (TIME,), values, attributes


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


def uniform_sample_time(time_s: NDArray[np.float64]) -> float:
    """Sample time of uniform stamps, s; refused where they are not uniform."""
    if time_s.ndim != 1 or time_s.size < 2:
        raise DataError("a record needs a time base", found=f"{time_s.size} stamps", needed="2")
    if not np.all(np.isfinite(time_s)):
        raise DataError("time stamps are not finite", needed="finite stamps in seconds")
    sample_time_s = float(time_s[-1] - time_s[0]) / (time_s.size - 1)
    if sample_time_s <= 0:
        raise DataError("time stamps do not increase", needed="increasing stamps in seconds")
    grid = time_s[0] + sample_time_s * np.arange(time_s.size)
    worst = float(np.max(np.abs(time_s - grid))) / sample_time_s
    if worst > UNIFORM_TOLERANCE:
        raise DataError(
            "time stamps are not uniform",
            found=f"a stamp {100 * worst:.3g} % of a sample time off the grid",
            needed=f"at most {100 * UNIFORM_TOLERANCE:g} %",
            action="bring the channels to one time base with conditioning.to_uniform",
        )
    return sample_time_s
