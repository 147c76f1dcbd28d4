"""Motors in the air: time at limits and balance between them, with intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.inspection.actuators import Actuators
from flightid.inspection.saturation import EDGE
from flightid.inspection.signals import Span, inside
from flightid.uncertainty.estimate import Estimate

STRETCHES = 10
"""Stretches of equal length whose scatter makes the intervals."""


@dataclass(frozen=True)
class MotorUse:
    """What one motor was asked for in the air.

    Attributes
    ----------
    name : str
        Where it is logged.
    mean : Estimate
        Mean command as a share of the range between its limits; interval by ten stretches.
    difference : Estimate
        Its mean command less that of all motors, over that of all motors.
    at_lower, at_upper : float
        Share of the samples at the lower and the upper limit.
    """

    name: str
    mean: Estimate
    difference: Estimate
    at_lower: float
    at_upper: float


def motor_use(actuators: Actuators | None, spans: tuple[Span, ...]) -> tuple[MotorUse, ...]:
    """What each motor was asked for; empty where no motors are logged in the air."""
    if actuators is None:
        return ()
    mask = inside(actuators.time_s, spans)
    if np.count_nonzero(mask) < 2 * STRETCHES:
        return ()
    span = actuators.high - actuators.low
    shares = (actuators.values[:, mask] - actuators.low) / span
    parts = np.array([part.mean(axis=1) for part in np.array_split(shares, STRETCHES, axis=1)])
    all_of_them = parts.mean()
    relative = parts / parts.mean(axis=1, keepdims=True) - 1.0 if all_of_them > 0 else 0.0 * parts
    return tuple(
        MotorUse(
            f"{actuators.message}.{name}",
            _mean("mean command", parts[:, place]),
            _mean("more than the mean of all", relative[:, place]),
            float(np.mean(shares[place] <= EDGE)),
            float(np.mean(shares[place] >= 1.0 - EDGE)),
        )
        for place, name in enumerate(actuators.names)
    )


def _mean(name: str, parts: NDArray[np.float64]) -> Estimate:
    spread = float(np.std(parts, ddof=1)) / math.sqrt(parts.size)
    return Estimate(name, float(parts.mean()), "1", spread, freedom=parts.size - 1)
