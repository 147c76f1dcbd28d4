"""A simulated flight as the DataFlash log that ArduCopter would have written of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import STANDARD_GRAVITY_M_S2
from flightid.errors import OptionError
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.vehicles.flight import Flight

FIRMWARE = "ArduCopter V4.6.0 (flightid)"
NOTICE = "Simulated by flightid: not a flight"
STABILIZE, SYSTEM_ID = 0, 25
ARMED, NOT_LANDED = 10, 28
POWER_UP_US = 10_000_000
"""The autopilot's clock starts at power-up: what a flight calls 0 s is 10 s in its log."""
SIDD_WRITE_DELAY_US = 900
"""RATE carries the stamp of the gyro sample, SIDD that of its own writing later in the loop."""
BASE_LOG_BITMASK = (1 << 3) | (1 << 4) | (1 << 7) | (1 << 9) | (1 << 10) | (1 << 12)
"""Performance, control, IMU, battery, motor outputs and PID."""
ATTITUDE_BITS = {1: 0b11, 2: 0b01, 4: 0b10, 8: 0b00}
"""ATTITUDE_FAST and ATTITUDE_MED: together every loop, else every second, fourth or eighth."""
FULL_BATTERY_V = 12.6

Columns = dict[str, NDArray[np.float64] | float]


def write_ardupilot_log(flight: Flight, path: str | Path) -> Path:
    """Write a simulated flight as a DataFlash log.

    Messages, fields, units, stamps and rates are ArduCopter's: RATE, ANG, ATT, PIDR, PIDP and PIDY
    at the rate that LOG_BITMASK chooses, SIDD while the system-identification mode is on, SIDS
    when it starts, IMU at 25 Hz, motor outputs and battery at 10 Hz, parameters, modes and events.
    The log's clock is 10 s ahead of the flight's (`POWER_UP_US`).
    SIDD.Targ is logged in the loop before the one whose RATE.ROut contains it.

    Parameters
    ----------
    flight : Flight
        What to write.
    path : str or Path
        File, usually ``*.BIN``; appears whole or not at all.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    OptionError
        The flight was kept at a rate that LOG_BITMASK does not offer.
    OSError
        The folder is missing or cannot be written.

    Reference
    ---------
    ArduPilot, ArduCopter/mode_systemid.cpp and AP_Logger structures (Copter 4.6).

    Example
    -------
    >>> import tempfile
    >>> import flightid as fid
    >>> from flightid.vehicles import fly
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log = fid.read_log(write_ardupilot_log(fly(duration_s=2.0), f"{folder}/sim.BIN"))
    >>> log.table("RATE")
    LogTable(RATE, 800 rows x 14, 400 Hz)
    """
    if flight.log_every not in ATTITUDE_BITS:
        raise OptionError(
            "the flight cannot be written",
            found=f"a row every {flight.log_every} loops",
            needed=f"one of {sorted(ATTITUDE_BITS)}",
        )
    writer = DataflashWriter()
    time_us = POWER_UP_US + np.round(flight.time_s * 1e6).astype(np.int64)
    _start(writer, flight)
    _attitude(writer, flight, time_us)
    _controllers(writer, flight, time_us)
    _sweeps(writer, flight, time_us)
    _slow(writer, flight, time_us)
    return writer.write(path)


def _start(writer: DataflashWriter, flight: Flight) -> None:
    parameters = flight.autopilot.parameters() | {
        "SID_AXIS": 0.0,
        "LOG_BITMASK": float(BASE_LOG_BITMASK | ATTITUDE_BITS[flight.log_every]),
        "MOT_THST_HOVER": flight.vehicle.hover_throttle,
    }
    if flight.runs:
        parameters |= flight.runs[0].parameters()
    for name, value in parameters.items():
        writer.parameter(name, value)
    for text in (FIRMWARE, NOTICE, "Frame: QUAD/X"):
        writer.message(POWER_UP_US, text)
    writer.add("EV", [POWER_UP_US] * 2, {"Id": np.array([ARMED, NOT_LANDED])})
    _mode(writer, POWER_UP_US, STABILIZE)


def _mode(writer: DataflashWriter, time_us: int, mode: int) -> None:
    writer.add("MODE", [time_us], {"Mode": [mode], "ModeNum": [mode], "Rsn": [1]})


def _degrees(flight: Flight, names: str) -> list[NDArray[np.float64]]:
    return [np.degrees(flight[name]) for name in names.split()]


def _heading(angle_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(angle_deg % 360.0)


def _attitude(writer: DataflashWriter, flight: Flight, time_us: NDArray[np.int64]) -> None:
    roll, pitch, yaw = _degrees(flight, "phi theta psi")
    to_roll, to_pitch, to_yaw = _degrees(flight, "phi_ref theta_ref psi_ref")
    angles: Columns = {
        "DesRoll": to_roll,
        "Roll": roll,
        "DesPitch": to_pitch,
        "Pitch": pitch,
        "DesYaw": _heading(to_yaw),
        "Yaw": _heading(yaw),
    }
    writer.add("ATT", time_us, angles | {"AEKF": 3})
    writer.add("ANG", time_us, angles | {"Dt": 1 / flight.autopilot.loop_rate_hz})
    p, q, r = _degrees(flight, "gyro_filtered_x gyro_filtered_y gyro_filtered_z")
    to_p, to_q, to_r = _degrees(flight, "p_ref q_ref r_ref")
    rates: Columns = {
        "RDes": to_p,
        "R": p,
        "ROut": flight["tau_phi"],
        "PDes": to_q,
        "P": q,
        "POut": flight["tau_theta"],
        "YDes": to_r,
        "Y": r,
        "YOut": flight["tau_psi"],
        "A": -(flight["accelerometer_z"] + STANDARD_GRAVITY_M_S2),
        "AOut": flight["thrust"],
        "AOutSlew": flight["thrust"],
    }
    writer.add("RATE", time_us, rates)


def _controllers(writer: DataflashWriter, flight: Flight, time_us: NDArray[np.int64]) -> None:
    fields = {"Tar": "target", "Err": "error", "P": "p", "I": "i", "D": "d", "FF": "ff"}
    for axis, message, letter in (
        ("roll", "PIDR", "x"),
        ("pitch", "PIDP", "y"),
        ("yaw", "PIDY", "z"),
    ):
        columns: Columns = {key: flight[f"{axis}_pid_{name}"] for key, name in fields.items()}
        columns |= {
            "DFF": flight[f"{axis}_pid_d_ff"],
            "Act": flight[f"gyro_filtered_{letter}"],
            "Dmod": flight[f"{axis}_pid_dmod"],
            "SRate": flight[f"{axis}_pid_slew_rate"],
            "Flags": flight["pid_limited"],
        }
        writer.add(message, time_us, columns)


def _sweeps(writer: DataflashWriter, flight: Flight, time_us: NDArray[np.int64]) -> None:
    active = flight["sid_axis"] > 0
    gyro = _degrees(flight, "gyro_mean_x gyro_mean_y gyro_mean_z")
    columns: Columns = {
        "Time": flight["sid_time_s"],
        "Targ": flight["sid_target"],
        "F": flight["sid_frequency_hz"],
    }
    columns |= {f"G{letter}": values for letter, values in zip("xyz", gyro, strict=True)}
    columns |= {f"A{letter}": flight[f"accelerometer_{letter}"] for letter in "xyz"}
    if active.any():
        chosen = {key: np.asarray(values)[active] for key, values in columns.items()}
        writer.add("SIDD", time_us[active] + SIDD_WRITE_DELAY_US, chosen)
    for run in flight.runs:
        start_us, end_us = (POWER_UP_US + round(1e6 * t) for t in (run.start_s, run.end_s))
        for name, value in run.parameters().items():
            writer.parameter(name, value, time_us=start_us - 1_000_000)
        _mode(writer, start_us, SYSTEM_ID)
        settings: Columns = {
            "Ax": run.axis,
            "Mag": run.magnitude,
            "FSt": run.start_hz,
            "FSp": run.stop_hz,
            "TFin": run.fade_in_s,
            "TC": 2 / run.start_hz,
            "TR": run.record_s,
            "TFout": run.fade_out_s,
        }
        writer.add("SIDS", [start_us], settings)
        _mode(writer, end_us, STABILIZE)


def _slow(writer: DataflashWriter, flight: Flight, time_us: NDArray[np.int64]) -> None:
    rate_hz = flight.autopilot.loop_rate_hz / flight.log_every
    tenth = slice(None, None, max(round(rate_hz / 10), 1))
    motors: Columns = {f"C{i}": np.round(flight[f"pwm_{i}"])[tenth] for i in range(1, 5)}
    writer.add("RCOU", time_us[tenth], motors)
    ratio = flight.autopilot.voltage_ratio
    expo = flight.autopilot.thrust_expo
    battery: Columns = {
        "LiftMax": ratio * (1 - expo) + expo * ratio**2,
        "BatVolt": ratio,
        "ThLimit": 1.0,
        "ThrOut": flight["thrust"][tenth],
    }
    writer.add("MOTB", time_us[tenth], battery)
    volts = ratio * FULL_BATTERY_V
    writer.add("BAT", time_us[tenth], {"Volt": volts, "VoltR": volts, "RemPct": 80, "H": 1})
    throttle: Columns = {
        "ThO": flight["thrust"][tenth],
        "ThH": flight.vehicle.hover_throttle,
        "Alt": -flight["down_m"][tenth],
    }
    writer.add("CTUN", time_us[tenth], throttle)
    part = slice(None, None, max(round(rate_hz / 25), 1))
    inertial: Columns = {f"Gyr{k.upper()}": flight[f"gyro_filtered_{k}"][part] for k in "xyz"}
    inertial |= {f"Acc{k.upper()}": flight[f"accelerometer_{k}"][part] for k in "xyz"}
    inertial |= {"GH": 1, "AH": 1, "GHz": flight.autopilot.loop_rate_hz}
    writer.add("IMU", time_us[part], inertial)
