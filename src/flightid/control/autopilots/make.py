"""From an autopilot's parameters to the loop of an axis."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.control.autopilots.arducopter import ArduCopterLoop, ArduHeliLoop
from flightid.control.autopilots.arduplane import ArduPlaneLoop
from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.betaflight_loop import betaflight_loop
from flightid.control.autopilots.gyro_notches import ardupilot_notches, pid_notch, px4_notches
from flightid.control.autopilots.inav_loop import inav_loop
from flightid.control.autopilots.notch_tracking import NotchTracking
from flightid.control.autopilots.parameter_table import AXES, Axis, defaults, resolve
from flightid.control.autopilots.px4_loop import Px4FixedWingLoop, Px4MulticopterLoop
from flightid.errors import OptionError
from flightid.logs.blackbox.settings import loop_step_s

AUTOPILOTS = (
    "arducopter", "arduheli", "arduplane", "px4_multicopter", "px4_fixed_wing", "betaflight",
    "inav",
)  # fmt: skip
LOOP_RATE_PARAMETERS = ("SCHED_LOOP_RATE", "IMU_GYRO_RATEMAX")


def axis_loop(
    autopilot: str,
    axis: str,
    parameters: Mapping[str, float] | None = None,
    *,
    loop_rate_hz: float | None = None,
    gyro_rate_hz: float | None = None,
    computation_delay_s: float = 0.0,
    airspeed_scale: float = 1.0,
    eas2tas: float = 1.0,
    notch_tracking: NotchTracking | None = None,
) -> AxisLoop:
    """Rate and angle controllers of one axis, exactly as an autopilot runs them.

    Parameters
    ----------
    autopilot : str
        ``"arducopter"``, ``"arduheli"``, ``"arduplane"``, ``"px4_multicopter"``,
        ``"px4_fixed_wing"``, ``"betaflight"`` or ``"inav"``.
    axis : {"roll", "pitch", "yaw"}
        Axis.
    parameters : mapping of str to float, optional
        Parameters by the autopilot's names; others are ignored. Default: a fresh vehicle.
    loop_rate_hz : float, optional
        Rate of the controller; default: SCHED_LOOP_RATE or IMU_GYRO_RATEMAX of the parameters.
    gyro_rate_hz : float, optional
        Rate at which the gyro is filtered; default: from INS_GYRO_RATE where the parameters have
        it, the loop rate otherwise.
    computation_delay_s : float
        From gyro sample to output, s; zero for a plant identified from logged outputs, which holds
        it already.
    airspeed_scale, eas2tas : float
        Scaling speed over airspeed, and true over equivalent airspeed (planes only).
    notch_tracking : NotchTracking, optional
        What notches that move followed; `axis_loop_of` reads it from a log.

    Raises
    ------
    OptionError
        No such autopilot or axis, or no loop rate.
    DataError
        Parameters that the controller needs are missing.

    Assumes
    -------
    Small signals for `feedback` and `forward`: no limit, no slew limiter at work, P and D not
    scaled by throttle (ATC_THR_G_BOOST). Notches that move in flight stand where `notch_tracking`
    has them; without it they are left out and named in `unknown_notches`.

    Reference
    ---------
    ArduPilot, libraries AC_PID, Filter, APM_Control, AC_AttitudeControl (4.5 to 4.7); PX4,
    src/lib/rate_control, src/modules/mc_rate_control, fw_rate_control and
    sensors/vehicle_angular_velocity (1.14 to 1.16).

    Example
    -------
    >>> loop = axis_loop("arducopter", "roll", {"ATC_RAT_RLL_P": 0.1, "ATC_RAT_RLL_I": 0.1,
    ...     "ATC_RAT_RLL_D": 0.003, "ATC_RAT_RLL_IMAX": 0.5, "ATC_ANG_RLL_P": 6.0,
    ...     "INS_GYRO_FILTER": 40.0, "SCHED_LOOP_RATE": 400.0})
    >>> loop.with_gains(ATC_RAT_RLL_P=0.15).gains["ATC_RAT_RLL_P"]
    0.15
    """
    if autopilot not in AUTOPILOTS:
        raise OptionError("autopilot is not known", found=autopilot, needed=f"one of {AUTOPILOTS}")
    if axis not in AXES:
        raise OptionError("axis is not known", found=axis, needed=f"one of {list(AXES)}")
    known = defaults(autopilot, axis) if parameters is None else parameters
    rate_hz = _loop_rate(known, loop_rate_hz)
    gyro_hz = gyro_rate_hz or _gyro_rate(known, rate_hz)
    found = resolve(autopilot, axis, known)
    kept: Axis = AXES[AXES.index(axis)]
    shared = (kept, found.values, found.names, rate_hz, gyro_hz, computation_delay_s)
    if autopilot == "betaflight":
        return betaflight_loop(found, known, shared, notch_tracking or NotchTracking())
    if autopilot == "inav":
        return inav_loop(found, known, shared, notch_tracking or NotchTracking())
    if autopilot.startswith("px4"):
        notches = px4_notches(known, gyro_hz, notch_tracking, AXES.index(kept))
        rest = (notches.sections, notches.unknown, found.assumed, ())
        if autopilot == "px4_fixed_wing":
            return Px4FixedWingLoop(*shared, *rest, airspeed_scale=airspeed_scale)
        old = found.names["k"] in found.assumed
        return Px4MulticopterLoop(*shared, *rest, old=old)
    notches = ardupilot_notches(known, gyro_hz, notch_tracking)
    rest = (notches.sections, notches.unknown, found.assumed, ())
    pair = (pid_notch(known, found.values["ntf"]), pid_notch(known, found.values["nef"]))
    if autopilot == "arduplane":
        return ArduPlaneLoop(*shared, *rest, *pair, airspeed_scale=airspeed_scale, eas2tas=eas2tas)
    kind = ArduHeliLoop if autopilot == "arduheli" else ArduCopterLoop
    return kind(*shared, *rest, *pair)


def _loop_rate(parameters: Mapping[str, float], given: float | None) -> float:
    if given is not None:
        return float(given)
    if found := told_loop_rate_hz(parameters):
        return found
    raise OptionError(
        "the rate of the controller is not known",
        needed="loop_rate_hz, or one of " + ", ".join((*LOOP_RATE_PARAMETERS, "looptime")),
    )


def told_loop_rate_hz(parameters: Mapping[str, float]) -> float | None:
    """Rate of the controller by the parameters, Hz; None where they do not tell it."""
    for name in LOOP_RATE_PARAMETERS:
        if parameters.get(name, 0.0) > 0:
            return float(parameters[name])
    step_s = loop_step_s(parameters)
    return None if step_s is None else 1.0 / step_s


def _gyro_rate(parameters: Mapping[str, float], loop_rate_hz: float) -> float:
    """ArduPilot filters the gyro at 1 kHz · 2^INS_GYRO_RATE; Betaflight's `looptime` is in µs."""
    if parameters.get("looptime", 0.0) > 0.0:
        return max(1e6 / parameters["looptime"], loop_rate_hz)
    if "INS_GYRO_RATE" in parameters:
        return max(1000.0 * 2.0 ** round(parameters["INS_GYRO_RATE"]), loop_rate_hz)
    return loop_rate_hz
