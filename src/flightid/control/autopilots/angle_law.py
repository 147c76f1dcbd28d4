"""How far an autopilot's angle controller is proportional, by its own parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from flightid.frozen import dataclass

BOUNDS_DEG_S2, YAW_BOUNDS_DEG_S2 = (40.0, 720.0), (10.0, 120.0)
"""Accelerations that ArduCopter's angle controller may plan with."""
_SHORT = {"roll": "RLL", "pitch": "PIT", "yaw": "YAW"}
_LEAST_TIME_S = 0.1


@dataclass(frozen=True)
class AngleLaw:
    """From an angle's error to a rate set-point: proportional up to an error, less beyond it.

    Attributes
    ----------
    gain_1_s : float
        Rate set-point over small errors, 1/s.
    proportional_to_rad : float
        Error up to which it holds, rad; infinite where no parameter ends it.
    bound : str
        The parameter that ends it; empty where none does.
    """

    gain_1_s: float
    proportional_to_rad: float
    bound: str


def angle_law(autopilot: str, parameters: Mapping[str, float], axis: str) -> AngleLaw | None:
    """How far the angle controller of an axis is proportional.

    Parameters
    ----------
    autopilot : str
        As of `axis_loop`.
    parameters : mapping of str to float
        By the autopilot's names.
    axis : {"roll", "pitch", "yaw"}
        Axis.

    Returns
    -------
    AngleLaw or None
        None where the parameters do not tell it, and of QuadPlanes and VTOLs, which have two.

    Reference
    ---------
    ArduPilot, AC_AttitudeControl::update_ang_vel_target_from_att_error (3.4 to 4.7: the square
    root of the error beyond acceleration / P², with half of ATC_ACCEL_x_MAX) and ang_vel_limit;
    APM_Control, AP_RollController::get_servo_out; PX4, AttitudeControl::update (rates limited).

    Example
    -------
    >>> found = angle_law("px4_multicopter", {"MC_ROLL_P": 6.5, "MC_ROLLRATE_MAX": 220.0}, "roll")
    >>> round(found.proportional_to_rad, 3), found.bound
    (0.591, 'MC_ROLLRATE_MAX')
    """
    if parameters.get("Q_ENABLE", 0.0) > 0.0 or parameters.get("VT_TYPE", -1.0) >= 0.0:
        return None
    gain = _gain(autopilot, parameters, axis)
    if gain is None or gain <= 0.0:
        return None
    errors = ((rate / gain, name) for name, rate in _rates(autopilot, parameters, axis))
    brakes = ((each / gain**2, name) for name, each in _brakes(autopilot, parameters, axis))
    return AngleLaw(gain, *min((*errors, *brakes), default=(math.inf, "")))


def planned_acceleration(axis: str, most_rad_s2: float) -> float:
    """What ArduCopter's angle controller brakes with, of ATC_ACCEL_x_MAX; rad/s², 0 is no bound.

    Example
    -------
    >>> round(planned_acceleration("roll", 19.2), 2), round(planned_acceleration("yaw", 4.7), 2)
    (9.6, 2.09)
    """
    bounds = YAW_BOUNDS_DEG_S2 if axis == "yaw" else BOUNDS_DEG_S2
    return float(np.clip(most_rad_s2 / 2.0, *np.radians(bounds))) if most_rad_s2 > 0.0 else 0.0


def _gain(autopilot: str, parameters: Mapping[str, float], axis: str) -> float | None:
    if autopilot in ("arducopter", "arduheli"):
        return parameters.get(f"ATC_ANG_{_SHORT[axis]}_P")
    if autopilot == "px4_multicopter":
        return parameters.get(f"MC_{axis.upper()}_P")
    names = {
        "arduplane": {"roll": "RLL2SRV_TCONST", "pitch": "PTCH2SRV_TCONST"},
        "px4_fixed_wing": {"roll": "FW_R_TC", "pitch": "FW_P_TC"},
    }.get(autopilot, {})
    time_s = parameters.get(names.get(axis, ""))
    return None if time_s is None else 1.0 / max(time_s, _LEAST_TIME_S)


def _rates(
    autopilot: str, parameters: Mapping[str, float], axis: str
) -> Iterator[tuple[str, float]]:
    """Largest rate set-points, rad/s; of parameters where 0 is no bound."""
    known: dict[str, dict[str, tuple[str, ...]]] = {
        "arduplane": {
            "roll": ("RLL2SRV_RMAX",),
            "pitch": ("PTCH2SRV_RMAX_UP", "PTCH2SRV_RMAX_DN"),
        },
        "px4_fixed_wing": {"roll": ("FW_R_RMAX",), "pitch": ("FW_P_RMAX_POS", "FW_P_RMAX_NEG")},
        "px4_multicopter": {axis: (f"MC_{axis.upper()}RATE_MAX",)},
    }
    copter = {axis: (f"ATC_RATE_{axis[0].upper()}_MAX",)}
    for name in known.get(autopilot, copter).get(axis, ()):
        if parameters.get(name, 0.0) > 0.0:
            yield name, math.radians(parameters[name])


def _brakes(
    autopilot: str, parameters: Mapping[str, float], axis: str
) -> Iterator[tuple[str, float]]:
    """Acceleration that ArduCopter brakes with, rad/s²: in cdeg/s² to 4.6, in deg/s² since."""
    if autopilot in ("arducopter", "arduheli"):
        for name, unit in (("ATC_ACCEL_{}_MAX", 0.01), ("ATC_ACC_{}_MAX", 1.0)):
            named = name.format(axis[0].upper())
            if parameters.get(named, 0.0) > 0.0:
                most = math.radians(unit * parameters[named])
                yield named, planned_acceleration(axis, most)
