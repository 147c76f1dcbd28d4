"""Motors in the air: time at limits and balance between them, with intervals."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.actuators import Actuators
from flightid.inspection.saturation import EDGE
from flightid.inspection.signals import Span, inside
from flightid.logs import Log
from flightid.uncertainty.estimate import Estimate

QUADROTOR = 4
STRETCHES = 10
"""Stretches of equal length whose scatter makes the intervals."""
LIMITS = ("motor-at-upper", "motor-at-lower")
"""Codes of findings that a motor has no room left: loops are not what they were tuned to be."""


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
    worked = parts[parts.mean(axis=1) > 0.0]
    relative = worked / worked.mean(axis=1, keepdims=True) - 1.0 if len(worked) > 2 else 0.0 * parts
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


def turning(log: Log, count: int) -> tuple[int, ...] | None:
    """Which way each motor turns, 1 or -1; None where the parameters do not tell.

    PX4 by the sign of CA_ROTORn_KM, ArduPilot for quadrotors of frame types + and X: motors 1 and 2
    turn counter-clockwise, 3 and 4 clockwise (AP_MotorsMatrix).
    """
    parameters = log.parameters
    if log.kind == "px4":
        moments = [parameters.get(f"CA_ROTOR{i}_KM", 0.0) for i in range(count)]
        return tuple(1 if m > 0 else -1 for m in moments) if all(moments) else None
    quadrotor = parameters.get("FRAME_CLASS") == 1.0 and parameters.get("FRAME_TYPE") in (0.0, 1.0)
    in_order = all(parameters.get(f"SERVO{i}_FUNCTION") == 32.0 + i for i in range(1, 5))
    return (1, 1, -1, -1) if quadrotor and in_order and count == QUADROTOR else None


def yaw_trim(
    actuators: Actuators | None, spans: tuple[Span, ...], ways: tuple[int, ...] | None
) -> Estimate | None:
    """How much harder motors work that turn one way than those that turn the other, of the mean."""
    if actuators is None or ways is None:
        return None
    mask = inside(actuators.time_s, spans)
    if np.count_nonzero(mask) < 2 * STRETCHES:
        return None
    shares = (actuators.values[:, mask] - actuators.low) / (actuators.high - actuators.low)
    one, other = (shares[np.array(ways) == way].mean(axis=0) for way in (1, -1))
    parts = np.array_split(np.vstack([one - other, 0.5 * (one + other)]), STRETCHES, axis=1)
    ratios = np.array([part[0].mean() / part[1].mean() for part in parts if part[1].mean() > 0.0])
    return _mean("counter-clockwise less clockwise motors", ratios) if ratios.size > 2 else None


def _mean(name: str, parts: NDArray[np.float64]) -> Estimate:
    spread = float(np.std(parts, ddof=1)) / math.sqrt(parts.size)
    return Estimate(name, float(parts.mean()), "1", spread, freedom=parts.size - 1)
