"""What to log or fly instead, in the autopilot's own settings."""

from __future__ import annotations

import math

from flightid.inspection.thresholds import (
    CYCLES_IN_WINDOW,
    INDEPENDENT_WINDOWS,
    LOWEST_OF_INTEREST,
)
from flightid.logs import Log

LOG_BITS = {
    0: "fast attitude: RATE, ATT and PID at the loop rate",
    1: "medium attitude; with bit 0 system identification data come at the loop rate",
    10: "motor outputs",
    12: "PID terms",
    18: "fast IMU",
}
"""Bits of ArduCopter's LOG_BITMASK that identification needs (ArduCopter/defines.h)."""
SDLOG_PROFILE = 25
"""PX4: default set 1, system identification 8, high rate 16 (logged_topics.cpp)."""
SWEEP_START_HZ, SWEEP_STOP_HZ, SWEEP_RECORD_S = 0.2, 20.0, 130
SID_MIXER = "SID_AXIS 10 (roll), 11 (pitch), 12 (yaw)"


def shortest_flight_s() -> float:
    """Flight time that five windows of two cycles at the lowest frequency of interest take, s."""
    return INDEPENDENT_WINDOWS.value * CYCLES_IN_WINDOW.value / LOWEST_OF_INTEREST.value


def logging(log: Log) -> str:
    """Settings that make the autopilot log fast enough."""
    if log.kind == "px4":
        return (
            f"set SDLOG_PROFILE {SDLOG_PROFILE} (default, system identification and high rate) and "
            "fly again"
        )
    present = log.parameters.get("LOG_BITMASK")
    if present is None or not 0 <= present < 2**31:
        bits = " + ".join(str(2**bit) for bit in LOG_BITS)
        return f"add {bits} to LOG_BITMASK (fast attitude, motor outputs, PID, fast IMU)"
    wanted = int(present) | sum(2**bit for bit in LOG_BITS)
    missing = [str(bit) for bit in LOG_BITS if not int(present) >> bit & 1]
    if not missing:
        return "LOG_BITMASK holds all that is needed: check for a card that is too slow"
    return f"set LOG_BITMASK {wanted} (now {int(present)}; bits {', '.join(missing)} are missing)"


def excitation(log: Log) -> str:
    """Manoeuvre that excites the axes."""
    repeats = "two runs an axis, one of them with the opposite sign, the other axes quiet"
    if log.kind == "px4":
        return (
            "fly piloted frequency sweeps of 90 s an axis from 0.3 Hz up, or the autotune "
            f"(MC_AT_START); {repeats}"
        )
    if log.vehicle == "copter":
        return (
            f"fly system identification mode with {SID_MIXER}, SID_F_START_HZ "
            f"{SWEEP_START_HZ:g}, SID_F_STOP_HZ {SWEEP_STOP_HZ:g}, SID_MAGNITUDE 0.1, "
            f"SID_T_FADE_IN 5, SID_T_REC {SWEEP_RECORD_S}, SID_T_FADE_OUT 5; {repeats}"
        )
    return f"fly sweeps or 3-2-1-1 steps about each axis; {repeats}"


def record_length(lowest_hz: float = LOWEST_OF_INTEREST.value) -> str:
    """How long to fly for a lowest frequency."""
    windows = INDEPENDENT_WINDOWS.value * CYCLES_IN_WINDOW.value / lowest_hz
    return (
        f"fly at least {math.ceil(windows):d} s an axis: five independent windows of two cycles "
        f"each at {lowest_hz:.2g} Hz"
    )
