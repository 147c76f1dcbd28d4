"""One channel out of a log: the first source that it holds, in the channel's unit and sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import MissingColumnError, UnitError
from flightid.frozen import dataclass
from flightid.logs.channels.channel_map import ChannelSource, MappedChannel
from flightid.logs.contents import LogContents
from flightid.logs.log_table import LogTable
from flightid.units import DIMENSIONLESS, convert, same_dimension

TURNED = {"roll": lambda a: a, "pitch": lambda a: -a, "yaw": lambda a: 0.5 * np.pi - a}
"""Angles of an aircraft's axes to north, east, down, from those of ROS (REP 103)."""


@dataclass(frozen=True, eq=False)
class ChannelSamples:
    """Samples of a channel with their own stamps.

    Attributes
    ----------
    channel : MappedChannel
        What was asked for.
    source : ChannelSource
        Where it was found.
    time_s, values : ndarray, shape (n,)
        Stamps, s, and samples in the channel's unit.
    """

    channel: MappedChannel
    source: ChannelSource
    time_s: NDArray[np.float64]
    values: NDArray[np.float64]

    @property
    def interval_s(self) -> float:
        """Median step of the stamps, s."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def note(self) -> str:
        """Source and what it is."""
        return f"{self.source}: {self.source.note}" if self.source.note else str(self.source)


def find(log: LogContents, channel: MappedChannel) -> ChannelSource | None:
    """The first source of a channel that the log holds with at least two rows."""
    for source in channel.sources:
        info = log.messages.get(source.message)
        if info is None or any(field not in info.fields for field in source.fields):
            continue
        wanted = source.instance
        if wanted is not None and info.instances and wanted not in info.instances:
            continue
        if len(_table(log, source)) >= 2:
            return source
    return None


def extract(
    log: LogContents, channel: MappedChannel, span_s: tuple[float, float] | None = None
) -> ChannelSamples:
    """Read a channel.

    Parameters
    ----------
    log : LogContents
        Log.
    channel : MappedChannel
        Channel and its candidate sources.
    span_s : (float, float), optional
        Keep the samples in this span and one on each side.

    Raises
    ------
    MissingColumnError
        The log holds none of the sources.
    UnitError
        The log declares a unit of another dimension than the channel's.
    """
    source = find(log, channel)
    if source is None:
        raise MissingColumnError(
            f"the log does not hold channel {channel.name!r}",
            needed=" or ".join(str(candidate) for candidate in channel.sources),
        )
    table = _table(log, source)
    time_s = _stamps(table, source)
    values = convert(_values(table, source), _unit(table, source, channel), channel.unit)
    if source.factor != 1.0:
        values *= source.factor
    if channel.unwrap:
        values = _unwrapped(values)
    if span_s is not None:
        inside = np.flatnonzero((time_s >= span_s[0]) & (time_s <= span_s[1]))
        if inside.size:
            kept = slice(max(inside[0] - 1, 0), inside[-1] + 2)
            time_s, values = time_s[kept], values[kept]
        else:
            time_s, values = time_s[:0], values[:0]
    return ChannelSamples(channel, source, time_s, values)


def _table(log: LogContents, source: ChannelSource) -> LogTable:
    """The rows of one instance: the named one, or the lowest."""
    instances = log.messages[source.message].instances
    instance = source.instance if source.instance is not None else min(instances, default=None)
    return log.table(source.message, instance if instances else None)


def _stamps(table: LogTable, source: ChannelSource) -> NDArray[np.float64]:
    if source.stamp is not None and source.stamp in table:
        return convert(table[source.stamp], table.unit(source.stamp), "s")
    return np.asarray(table.time_s)


def _values(table: LogTable, source: ChannelSource) -> NDArray[np.float64]:
    fields = [*table.arrays(source.fields).values()]
    if source.angle is not None:
        turned = _euler(source.angle, *fields)
        return TURNED[source.angle](turned) if source.frame == "enu" else turned
    # One field is not copied: of a large log each copy counts.
    total = fields[0] if len(fields) == 1 else np.asarray(np.sum(fields, axis=0), np.float64)
    if source.zero:
        total = total - source.zero
    if source.cut and np.array_equal(total, np.trunc(total)):
        # A loop whose set-point is logged too small seems to answer it by more than all.
        total = total + 0.5 * np.sign(total)
    if source.phase_scale is not None:
        return np.where(total == 0.0, 0.0, np.cos(total / source.phase_scale))
    return total


def _unit(table: LogTable, source: ChannelSource, channel: MappedChannel) -> str:
    """Unit of the stored numbers: the log's word first, then the map's, then the channel's."""
    declared = DIMENSIONLESS if source.angle is not None else table.unit(source.fields[0])
    if declared == DIMENSIONLESS:
        return source.unit or channel.unit
    unit = declared if source.factor == 1.0 else channel.unit
    if not same_dimension(unit, channel.unit):
        raise UnitError(
            f"channel {channel.name!r} has another dimension in the log",
            found=f"{source} in {declared}",
            needed=channel.unit,
        )
    return unit


def _euler(angle: str, *q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Euler angle (z-y-x) of unit quaternions, scalar first, body to earth.

    Stevens, Lewis & Johnson, Aircraft Control and Simulation (3rd ed.), eq. (1.8-21).
    """
    w, x, y, z = q
    if angle == "roll":
        return np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    if angle == "pitch":
        return np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _unwrapped(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle without jumps; samples that are not finite stay so and do not disturb the others."""
    finite = np.isfinite(values)
    unwrapped = values.copy()
    unwrapped[finite] = np.unwrap(values[finite])
    return unwrapped
