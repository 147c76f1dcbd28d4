"""The controllers that a log was flown with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.make import LOOP_RATE_PARAMETERS, axis_loop
from flightid.control.autopilots.notch_tracking import notch_tracking
from flightid.control.autopilots.parameter_table import parameter_entries
from flightid.errors import DataError
from flightid.inspection.actuators import find_actuators
from flightid.inspection.excitation_found import injected_spans
from flightid.inspection.flight_phases import flight_phases
from flightid.inspection.signals import Span
from flightid.inspection.stamps import log_span
from flightid.logs import Log
from flightid.logs.blackbox.firmware import firmware_of

AUTOPILOT_OF = {
    ("ardupilot", "copter"): "arducopter",
    ("ardupilot", "plane"): "arduplane",
    ("px4", "copter"): "px4_multicopter",
    ("px4", "plane"): "px4_fixed_wing",
    ("betaflight", "copter"): "betaflight",
    ("inav", "copter"): "inav",
}
HELICOPTER_FRAMES = (6.0, 11.0, 13.0)
"""FRAME_CLASS of single, dual and quad helicopters."""
SCALE_BOUNDS = (0.5, 2.0)
OLDEST = {"betaflight": (3, 1), "inav": (3, 0)}
"""Before, D acted on other signals, and headers did not tell it."""
SLOWEST_LOOP_HZ = 100.0
"""No rate controller runs slower: such a message was thinned out by the logger."""


def autopilot_of(log: Log) -> str:
    """Name of the autopilot that wrote a log, as `axis_loop` takes it.

    Raises
    ------
    DataError
        Its controllers are not known here.
    """
    name = AUTOPILOT_OF.get((log.kind, log.vehicle or ""))
    if name is None:
        raise DataError(
            "the controllers of this vehicle are not known",
            found=f"{log.kind} {log.vehicle or 'vehicle not told'}",
            needed=" or ".join(" ".join(pair) for pair in AUTOPILOT_OF),
        )
    if name == "arducopter" and log.parameters.get("FRAME_CLASS") in HELICOPTER_FRAMES:
        return "arduheli"
    # A blackbox that was decoded without its header has no gains, whatever wrote it.
    if name in OLDEST and log.parameters and firmware_of(log.firmware).version < OLDEST[name]:
        raise DataError(
            "the controllers of this firmware are not known",
            found=log.firmware or "a firmware that is not named",
            needed="Betaflight 3.1 or newer, INAV 3 or newer, whose loops are known",
            action=f"flightid flight {log.path.name} tells steps and noise all the same; for gains "
            "fly such a firmware",
        )
    return name


def parameters_at(log: Log, time_s: float) -> dict[str, float]:
    """Parameters as they stood at an instant on the autopilot's clock."""
    values = dict(log.parameters)
    for change in reversed(log.parameter_changes):
        if change.time_s is not None and change.time_s > time_s:
            values[change.name] = change.old
    return values


def axis_loop_of(
    log: Log,
    axis: str,
    *,
    at_s: float | None = None,
    loop_rate_hz: float | None = None,
    airspeed_scale: float | None = None,
) -> AxisLoop:
    """Controllers of an axis as a log was flown with them.

    Parameters
    ----------
    log : Log
        ArduCopter, ArduPlane, PX4 multicopter or fixed wing, Betaflight 3.1 or INAV 3, or newer.
    axis : {"roll", "pitch", "yaw"}
        Axis.
    at_s : float, optional
        Instant on the autopilot's clock whose parameters count; default: the start of the first
        system-identification run, or any instant where none of the parameters changed.
    loop_rate_hz : float, optional
        Rate of the controller where the log does not tell it.
    airspeed_scale : float, optional
        Scaling speed over airspeed (planes); default: from the log's mean airspeed.

    Raises
    ------
    DataError
        Parameters are missing (all are named), or changed in flight and no instant was given.
    OptionError
        The log does not tell the rate of the controller.

    Reference
    ---------
    As `axis_loop`; ArduPlane, speed scaling of Attitude.cpp.

    Example
    -------
    >>> import tempfile
    >>> import flightid as fid
    >>> from flightid.vehicles import fly, write_ardupilot_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log = fid.read_log(write_ardupilot_log(fly(duration_s=2.0), f"{folder}/sim.BIN"))
    ...     axis_loop_of(log, "roll")
    AxisLoop(arducopter roll, 400 Hz, P 0.09, I 0.09, D 0.0024, FF 0)
    """
    autopilot = autopilot_of(log)
    if not log.parameters:
        raise DataError(
            "the log holds no parameters, so its gains are not known",
            found=log.path.name,
            needed="the autopilot's own log of such a flight",
            action="identify from this one (flightid run), then tune its models with that log: "
            "flightid tune MODEL --log LOG",
        )
    parameters = _chosen_parameters(log, autopilot, axis, at_s)
    rate_hz = loop_rate_hz or _loop_rate(log, parameters)
    options: dict[str, Any] = {"gyro_rate_hz": _gyro_rate(log, rate_hz)}
    notes = _notes(parameters)
    options["notch_tracking"] = notch_tracking(log, _counted(log, at_s))
    if autopilot in ("arduplane", "px4_fixed_wing"):
        scale, note = _airspeed_scale(log, parameters, airspeed_scale)
        options["airspeed_scale"] = scale
        notes += note
    loop = axis_loop(autopilot, axis, parameters, loop_rate_hz=rate_hz, **options)
    return loop.with_notes(notes)


def _chosen_parameters(log: Log, autopilot: str, axis: str, at_s: float | None) -> dict[str, float]:
    if at_s is None and log.sid_runs:
        at_s = log.sid_runs[0].start_s
    if at_s is not None:
        return parameters_at(log, at_s)
    names = {entry.name for entry in parameter_entries(autopilot, axis)}
    changed = sorted({c.name for c in log.parameter_changes if c.name in names and c.old != c.new})
    if changed:
        raise DataError(
            "the controller's parameters changed in flight",
            found=", ".join(changed),
            needed="an instant",
            action="pass at_s, on the autopilot's clock",
        )
    return log.parameters


def _counted(log: Log, at_s: float | None) -> list[Span]:
    """Where notches and throttle count: the sweeps, else what was flown, else the whole log."""
    if at_s is None and (swept := injected_spans(log)):
        return swept
    return list(flight_phases(log, find_actuators(log)).airborne) or [log_span(log)]


def _loop_rate(log: Log, parameters: Mapping[str, float]) -> float | None:
    """PX4 before 1.11 ran its controllers at the rate of sensor_combined."""
    if log.kind == "px4" and not any(parameters.get(name) for name in LOOP_RATE_PARAMETERS):
        rate = _rate(log, "sensor_combined")
        return rate if rate is not None and rate >= SLOWEST_LOOP_HZ else None
    return None


def _rate(log: Log, message: str) -> float | None:
    return log.messages[message].rate_hz if message in log else None


def _gyro_rate(log: Log, loop_rate_hz: float | None) -> float | None:
    """What the log tells of the rate of the gyro filters; None where it tells nothing."""
    for message, field in (("IMU", "GHz"), ("vehicle_imu_status", "gyro_raw_rate_hz")):
        if message not in log or field not in log.table(message):
            continue
        first = min(log.messages[message].instances, default=None)
        rate = float(np.median(log.table(message, first)[field]))
        if np.isfinite(rate) and rate > 0:
            return max(rate, loop_rate_hz or 0.0, 1.0)
    return None


def _notes(parameters: Mapping[str, float]) -> tuple[str, ...]:
    notes = []
    if parameters.get("FSTRATE_ENABLE", 0.0):
        notes.append(
            "FSTRATE_ENABLE runs the rate controller in a thread of its own, faster than "
            "SCHED_LOOP_RATE: this view still takes the latter"
        )
    if parameters.get("ATC_THR_G_BOOST", 0.0):
        notes.append("ATC_THR_G_BOOST raises P and D while the throttle moves: not in this view")
    return tuple(notes)


def _airspeed_scale(
    log: Log, parameters: Mapping[str, float], given: float | None
) -> tuple[float, tuple[str, ...]]:
    if given is not None:
        return given, ()
    px4 = log.kind == "px4"
    if px4 and parameters.get("FW_ARSP_SCALE_EN", 1.0) == 0:
        return 1.0, ()
    speed = parameters.get("FW_AIRSPD_TRIM" if px4 else "SCALING_SPEED")
    sources = (
        ("airspeed_validated", "calibrated_airspeed_m_s"),
        ("CTUN", "As"),
        ("ARSP", "Airspeed"),
    )
    for message, field in sources:
        if speed and message in log and field in log.table(message):
            airspeed = log.table(message)[field]
            moving = airspeed[np.isfinite(airspeed) & (airspeed > 0.3 * speed)]
            if moving.size:
                mean = float(moving.mean())
                scale = float(np.clip(speed / mean, *SCALE_BOUNDS))
                return scale, (f"gains are scaled for the mean airspeed, {mean:.3g} m/s",)
    return 1.0, ("the log tells no airspeed: gains are taken as at the scaling speed",)
