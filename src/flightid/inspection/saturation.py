"""What hit its limits while the vehicle flew: motors, mixer commands, gyroscopes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flightid.inspection.actuators import Actuators
from flightid.inspection.axes import axes_of
from flightid.inspection.signals import Span, find, inside
from flightid.inspection.thresholds import GYRO_RANGE
from flightid.logs import Log

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
    """

    what: str
    limit: str
    share: float


def saturations(
    log: Log, spans: tuple[Span, ...], actuators: Actuators | None
) -> tuple[Saturation, ...]:
    """Everything that was at a limit for part of the flight, most first."""
    found = [
        *_motors(actuators, spans),
        *_commands(log, spans),
        *_gyroscopes(log, spans),
    ]
    return tuple(
        sorted((one for one in found if one.share > 0), key=lambda one: one.share, reverse=True)
    )


def _motors(actuators: Actuators | None, spans: tuple[Span, ...]) -> list[Saturation]:
    if actuators is None:
        return []
    mask = inside(actuators.time_s, spans)
    if not np.any(mask):
        return []
    slack = EDGE * (actuators.high - actuators.low)
    found = []
    for name, values in zip(actuators.names, actuators.values[:, mask], strict=True):
        label = f"{actuators.message}.{name}"
        at_low = float(np.mean(values <= actuators.low + slack))
        at_high = float(np.mean(values >= actuators.high - slack))
        found.append(Saturation(label, f"lower limit {actuators.low:.4g}", at_low))
        found.append(Saturation(label, f"upper limit {actuators.high:.4g}", at_high))
    return found


def _commands(log: Log, spans: tuple[Span, ...]) -> list[Saturation]:
    found = []
    for axis in axes_of(log.vehicle).values():
        signal = find(log, axis.command)
        values = signal.within(spans) if signal is not None else np.empty(0)
        if signal is not None and signal.unit == "1" and values.size:
            share = float(np.mean(np.abs(values) >= 1.0 - EDGE))
            found.append(Saturation(signal.label, "mixer limit 1", share))
    return found


def _gyroscopes(log: Log, spans: tuple[Span, ...]) -> list[Saturation]:
    found = []
    for axis in axes_of(log.vehicle).values():
        signal = find(log, axis.rate)
        values = signal.within(spans) if signal is not None else np.empty(0)
        if signal is not None and values.size:
            share = float(np.mean(np.abs(values) >= GYRO_RANGE.value))
            found.append(Saturation(signal.label, "gyroscope range 2000 deg/s", share))
    if "VIBE" in log and "Clip" in log.messages["VIBE"].fields:
        table = log.table("VIBE", (log.messages["VIBE"].instances or (None,))[0])
        mask = inside(table.time_s, spans)
        if np.count_nonzero(mask) > 1:
            share = float(np.mean(np.diff(table["Clip"][mask]) > 0))
            found.append(Saturation("VIBE.Clip", "accelerometer range", share))
    return found
