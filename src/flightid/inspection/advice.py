"""What to log or fly instead, in the autopilot's own settings."""

from __future__ import annotations

import math

from flightid.inspection.thresholds import (
    CYCLES_IN_WINDOW,
    INDEPENDENT_WINDOWS,
    LOWEST_OF_INTEREST,
)
from flightid.logs import Log

COPTER_LOG_BITS = {
    0: "fast attitude: RATE, ATT and PID at the loop rate",
    1: "medium attitude; with bit 0 system identification data come at the loop rate",
    10: "motor outputs",
    12: "PID terms",
    18: "fast IMU",
}
"""Bits of ArduCopter's LOG_BITMASK that identification needs (ArduCopter/defines.h)."""
PLANE_LOG_BITS = {7: "IMU", 13: "servo outputs", 20: "attitude and PID terms at the loop rate"}
"""The same of ArduPlane, which numbers them otherwise (ArduPlane/defines.h)."""
LOG_BITS = {"copter": COPTER_LOG_BITS, "plane": PLANE_LOG_BITS}
LOGGING = {
    "betaflight": "set blackbox_sample_rate 1/2 or faster, and log set-point, gyro and PID terms",
    "inav": "set blackbox_rate_num 1 and blackbox_rate_denom 2 or faster",
    "mavlink": "hand in the log that the autopilot wrote to its own card: telemetry is too slow",
}
SDLOG_PROFILE = 25
"""PX4: default set 1, system identification 8, high rate 16 (logged_topics.cpp)."""
SID_MIXER = "SID_AXIS 10 (roll), 11 (pitch), 12 (yaw)"


def shortest_flight_s() -> float:
    """Flight time that five windows of two cycles at the lowest frequency of interest take, s."""
    return INDEPENDENT_WINDOWS.value * CYCLES_IN_WINDOW.value / LOWEST_OF_INTEREST.value


DECLARATIONS = {"FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG", "VER"}
"""Messages of ArduPilot that stand before its first measurement."""
TOO_SHORT_S = 1.0
"""Of an ArduPilot log: it writes parameters between rows, so more may have been to come (ours)."""


def cut_short(log: Log) -> str:
    """Where a log ends before it tells what its autopilot logs, in words; empty: it does not."""
    if log.kind not in ("ardupilot", "px4"):
        return ""
    if not set(log.messages) - DECLARATIONS:
        return "before anything was measured"
    if log.kind == "ardupilot" and log.duration_s < TOO_SHORT_S:
        return f"{log.duration_s:.2g} s after its first stamp"
    return ""


def whole_log(end: str) -> str:
    """What to do about a log that ends there."""
    return f"hand in the whole log: what is left of it ends {end}"


def logging(log: Log) -> str:
    """Settings that make the autopilot log fast enough."""
    if end := cut_short(log):
        return whole_log(end)
    if log.kind == "px4":
        return _px4_logging(log)
    if log.kind in LOGGING:
        return LOGGING[log.kind]
    return _ardupilot_logging(log)


def _ardupilot_logging(log: Log) -> str:
    """The bits of LOG_BITMASK that are missing, by what the log tells of it."""
    wanted_bits = LOG_BITS.get(log.vehicle or "")
    present = log.parameters.get("LOG_BITMASK")
    if wanted_bits is None:
        return "log attitude, rates, outputs and PID terms at the loop rate (LOG_BITMASK)"
    if present is None or not 0 <= present < 2**31:
        return set_bits(wanted_bits)
    wanted = int(present) | sum(2**bit for bit in wanted_bits)
    missing = [str(bit) for bit in wanted_bits if not int(present) >> bit & 1]
    if not missing:
        return "LOG_BITMASK holds all that is needed: check for a card that is too slow"
    which = f"bit {missing[0]} is" if len(missing) == 1 else f"bits {', '.join(missing)} are"
    return f"set LOG_BITMASK {wanted} (now {int(present)}; {which} missing)"


def set_bits(wanted: dict[int, str]) -> str:
    """Bits of LOG_BITMASK by number: a sum would clear others where one is set already."""
    named = ", ".join(f"{bit} ({what})" for bit, what in wanted.items())
    return f"set bits {named} of LOG_BITMASK, and leave its other bits as they are"


def _px4_logging(log: Log) -> str:
    """The logging profile, where the firmware that flew has one."""
    present = log.parameters.get("SDLOG_PROFILE")
    if present is None:
        return (
            "log commands and body rates at full rate: the parameters of this firmware hold no "
            f"SDLOG_PROFILE; newer ones take SDLOG_PROFILE {SDLOG_PROFILE}"
        )
    wanted = int(present) | SDLOG_PROFILE
    if wanted == int(present):
        return f"SDLOG_PROFILE {wanted} holds all that is needed: check for a card that is too slow"
    return (
        f"set SDLOG_PROFILE {wanted} (now {int(present)}; with system identification and high "
        "rate) and fly again"
    )


def excitation(log: Log) -> str:
    """Manoeuvre that excites the axes; its numbers come from the flight plan of that very log."""
    repeats = "two runs an axis, one of them with the opposite sign, the other axes quiet"
    piloted = "fly piloted frequency sweeps of 90 s an axis from 0.3 Hz up"
    sized = (
        f"{repeats}: flightid plan {log.path.name} writes amplitude, a card and, of a go, settings"
    )
    if log.kind == "px4":
        tunes = [name for name in ("MC_AT_START", "FW_AT_START") if name in log.parameters]
        autotune = f", or the autotune ({' or '.join(tunes)})" if tunes else ""
        return f"{piloted}{autotune}; {sized}"
    if log.kind == "betaflight":
        return (
            "fly the CHIRP mode of firmware 2025.12 or later (a build with USE_CHIRP), debug_mode "
            f"CHIRP, or {piloted.removeprefix('fly ')}; {sized}"
        )
    if log.kind == "inav":
        return f"{piloted}, in ANGLE; {sized}"
    unknown = "SID_AXIS" not in log.parameters and log.parameters and not log.sid_runs
    if log.vehicle == "copter" and unknown:
        return f"{piloted}; {sized}"
    if log.vehicle == "copter":
        return f"fly system identification mode with {SID_MIXER}; {sized}"
    swept = "fly sweeps or 3-2-1-1 steps about each axis"
    return f"{swept}; {sized if log.vehicle == 'plane' else repeats}"


def more_injected(log: Log) -> str:
    """What to do where the rate answers gusts more than what was injected."""
    return (
        "inject with more amplitude, in less wind or for longer: flightid plan "
        f"{log.path.name} writes the amplitude"
    )


def record_length(lowest_hz: float = LOWEST_OF_INTEREST.value) -> str:
    """How long to fly for a lowest frequency."""
    windows = INDEPENDENT_WINDOWS.value * CYCLES_IN_WINDOW.value / lowest_hz
    return (
        f"fly at least {math.ceil(windows):d} s an axis: five independent windows of two cycles "
        f"each at {lowest_hz:.2g} Hz"
    )
