"""What hit its limits while the vehicle flew: motors, mixer commands, gyroscopes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.actuators import Actuators
from flightid.inspection.axes import axes_of
from flightid.inspection.signals import Span, find, inside, place_of
from flightid.inspection.thresholds import GYRO_RANGE
from flightid.logs import Log

PID_MIXER_SCALING = 1000.0
"""Of Betaflight: the sum of PID terms that is a command of one."""
EDGE = 0.005
"""Share of the range within which a command counts as at its limit."""


@dataclass(frozen=True)
class Saturation:
    """Share of the flight that something spent at a limit.

    Attributes
    ----------
    what : str
        Actuator, command or sensor.
    limit : str
        Which limit, with its value.
    share : float
        Of the samples in the air, 0 to 1.
    axis : str
        Of a command; empty of motors and sensors.
    """

    what: str
    limit: str
    share: float
    axis: str = ""


@dataclass(frozen=True, eq=False)
class LimitContact:
    """When something was at a limit in the air.

    Attributes
    ----------
    what, limit, axis : str
        As in `Saturation`.
    time_s : ndarray, shape (n,)
        Stamps in the air, s.
    touched : ndarray of bool, shape (n,)
        Whether it was at the limit.
    """

    what: str
    limit: str
    time_s: NDArray[np.float64]
    touched: NDArray[np.bool_]
    axis: str = ""

    def spans(self, apart_s: float) -> list[Span]:
        """Spans at the limit, s; those closer than `apart_s` are one."""
        stamps = self.time_s[self.touched]
        if stamps.size == 0:
            return []
        ends = np.flatnonzero(np.diff(stamps) > apart_s)
        firsts, lasts = np.r_[0, ends + 1], np.r_[ends, stamps.size - 1]
        return [(float(stamps[i]), float(stamps[k])) for i, k in zip(firsts, lasts, strict=True)]


def saturations(
    log: Log, spans: tuple[Span, ...], actuators: Actuators | None
) -> tuple[Saturation, ...]:
    """Everything that was at a limit for part of the flight, most first."""
    found = [
        Saturation(each.what, each.limit, float(np.mean(each.touched)), each.axis)
        for each in limit_contacts(log, spans, actuators)
    ]
    return tuple(
        sorted((one for one in found if one.share > 0), key=lambda one: one.share, reverse=True)
    )


def limit_contacts(
    log: Log, spans: tuple[Span, ...], actuators: Actuators | None
) -> Iterator[LimitContact]:
    """Whatever can be at a limit, with the samples at which it was."""
    yield from _motors(actuators, spans)
    yield from _commands(log, spans)
    yield from _gyroscopes(log, spans)


def _motors(actuators: Actuators | None, spans: tuple[Span, ...]) -> Iterator[LimitContact]:
    if actuators is None:
        return
    mask = inside(actuators.time_s, spans)
    if not np.any(mask):
        return
    slack, time_s = EDGE * (actuators.high - actuators.low), actuators.time_s[mask]
    low, high = f"lower limit {actuators.low:.4g}", f"upper limit {actuators.high:.4g}"
    for name, whole in zip(actuators.names, actuators.values, strict=True):
        label, values = f"{actuators.message}.{name}", whole[mask]
        yield LimitContact(label, low, time_s, values <= actuators.low + slack)
        yield LimitContact(label, high, time_s, values >= actuators.high - slack)


def _commands(log: Log, spans: tuple[Span, ...]) -> Iterator[LimitContact]:
    for name, axis in axes_of(log.vehicle).items():
        signal = find(log, axis.command)
        if signal is None or signal.unit != "1":
            continue
        most, limit = _command_limit(log, name)
        part = place_of(signal.time_s, spans)
        touched = np.abs(signal.values[part]) >= most * (1.0 - EDGE)
        if touched.size:
            yield LimitContact(signal.label, limit, signal.time_s[part], touched, name)


def _command_limit(log: Log, axis: str) -> tuple[float, str]:
    """Largest command that the mixer takes of an axis, and its name.

    Betaflight cuts the sum of the PID terms before it mixes (`mixTable` of its ``mixer.c``).
    """
    name = "pidsum_limit_yaw" if axis == "yaw" else "pidsum_limit"
    most = log.parameters.get(name, 0.0) if log.kind == "betaflight" else 0.0
    if not 0.0 < most < PID_MIXER_SCALING:
        return 1.0, "mixer limit 1"
    return most / PID_MIXER_SCALING, f"limit {name} {most:g}"


def _gyroscopes(log: Log, spans: tuple[Span, ...]) -> Iterator[LimitContact]:
    for axis in axes_of(log.vehicle).values():
        signal = find(log, axis.rate)
        if signal is None:
            continue
        part = place_of(signal.time_s, spans)
        touched = np.abs(signal.values[part]) >= GYRO_RANGE.value
        if touched.size:
            limit = "gyroscope range 2000 deg/s"
            yield LimitContact(signal.label, limit, signal.time_s[part], touched)
    if "VIBE" in log and "Clip" in log.messages["VIBE"].fields:
        table = log.table("VIBE", (log.messages["VIBE"].instances or (None,))[0])
        mask = inside(table.time_s, spans)
        if np.count_nonzero(mask) > 1:
            clipped = np.diff(table["Clip"][mask]) > 0
            limit = "accelerometer range"
            yield LimitContact("VIBE.Clip", limit, table.time_s[mask][1:], clipped)
