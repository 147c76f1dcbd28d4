"""Settings that make an autopilot sweep an axis and log it, each beside the value it replaces."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from flightid.control.autopilots.parameter_files import GainChange
from flightid.errors import OptionError
from flightid.excitation import Excitation
from flightid.inspection.advice import LOG_BITS, SDLOG_PROFILE
from flightid.planning.options import PlanOptions
from flightid.planning.procedures import Procedure

SID_AXES = {"roll": 10, "pitch": 11, "yaw": 12}
"""SID_AXIS that inject at the mixer, behind the controllers."""
LETTERS = {"roll": "RLL", "pitch": "PIT", "yaw": "YAW"}
SID_NAMES = {
    "SID_AXIS": "axis",
    "SID_MAGNITUDE": "magnitude",
    "SID_F_START_HZ": "start_hz",
    "SID_F_STOP_HZ": "stop_hz",
    "SID_T_FADE_IN": "fade_in_s",
    "SID_T_FADE_OUT": "fade_out_s",
    "SID_T_REC": "record_s",
}
LEAST_DECIMAL = 0.1
"""Of a setting: below it three decimals are fewer than three digits."""
# Ranges that the autopilots document; they would clip or refuse in flight, which is too late.
RANGES = {
    "SID_F_START_HZ": (0.01, 100.0),
    "SID_F_STOP_HZ": (0.01, 100.0),
    "SID_T_FADE_IN": (0.0, 20.0),
    "SID_T_REC": (0.0, 255.0),
    "SID_T_FADE_OUT": (0.0, 5.0),
    "FW_AT_SYSID_F0": (0.1, 30.0),
    "FW_AT_SYSID_F1": (0.1, 30.0),
    "FW_AT_SYSID_TIME": (5.0, 120.0),
    "chirp_amplitude_roll": (1.0, 500.0),
    "chirp_amplitude_pitch": (1.0, 500.0),
    "chirp_amplitude_yaw": (1.0, 500.0),
    "chirp_frequency_start_deci_hz": (1.0, 1000.0),
    "chirp_frequency_end_deci_hz": (2.0, 10000.0),
    "chirp_time_seconds": (1.0, 200.0),
}
INTEGERS = ("SDLOG_PROFILE", "FW_AT_APPLY", "FW_AT_AXES", "FW_AT_SYSID_TYPE")
"""Parameters that PX4 keeps as integers."""
LOGARITHMIC_SWEEP, ALL_AXES = 2, 7
AUTOTUNE_BAND_RAD_S, AUTOTUNE_S = (math.tau * 0.5, math.tau * 10.0), 30.0
"""Of PX4's sweep where nobody says otherwise."""


def settings_of(
    procedure: Procedure,
    axis: str,
    excitation: Excitation | None,
    current: Mapping[str, float],
    axes: tuple[str, ...] = (),
    asked: PlanOptions | None = None,
) -> tuple[GainChange, ...]:
    """What to set for one axis.

    Parameters
    ----------
    procedure : Procedure
    axis : {"roll", "pitch", "yaw"}
    excitation : Excitation, optional
        The sweep; None where the pilot or the autopilot makes it.
    current : mapping of str to float
        Parameters as they are on the vehicle; empty: not known.
    axes : tuple of str
        All axes of the plan: what the others' files change is put back by this one.
    asked : PlanOptions, optional
        Band and length of a sweep that the autopilot sizes.

    Raises
    ------
    OptionError
        A setting outside the autopilot's range.

    Reference
    ---------
    ArduPilot, ArduCopter/mode_systemid.cpp (4.6) and its Methodic Configurator, step "system
    identification"; PX4, fw_autotune_attitude_control and logged_topics.cpp; Betaflight, cli.
    """
    wanted: dict[str, tuple[float, str]] = {}
    if procedure.how == "mode" and excitation is not None:
        wanted |= _system_identification(procedure, axis, excitation, current, axes)
    if procedure.how == "chirp":
        wanted |= _chirp(axis, asked or PlanOptions())
    if procedure.how == "autotune":
        wanted |= _autotune_sweep(asked or PlanOptions())
    wanted |= _logging(procedure, current)
    for name, (value, _) in wanted.items():
        low, high = RANGES.get(name, (-math.inf, math.inf))
        if not low <= value <= high:
            raise OptionError(
                f"{name} leaves the autopilot's range", found=value, needed=f"{low:g} to {high:g}"
            )
    if "SID_AXIS" in wanted and current:
        # Hidden or not there, it was off.
        current = {"SID_AXIS": 0.0} | dict(current)
    return tuple(
        GainChange(name, float(value), old=current.get(name), reason=reason)
        for name, (value, reason) in wanted.items()
    )


def _autotune_sweep(asked: PlanOptions) -> dict[str, tuple[float, str]]:
    """The sweep of PX4's autotune, whose amplitude it finds by itself."""
    band = asked.band_rad_s or AUTOTUNE_BAND_RAD_S
    return {
        "FW_AT_APPLY": (0, "log its gains, do not apply them"),
        "FW_AT_AXES": (ALL_AXES, "roll, pitch and yaw"),
        "FW_AT_SYSID_TYPE": (LOGARITHMIC_SWEEP, "logarithmic sweep"),
        "FW_AT_SYSID_F0": (round(band[0] / math.tau, 3), ""),
        "FW_AT_SYSID_F1": (round(band[1] / math.tau, 3), ""),
        "FW_AT_SYSID_TIME": (asked.duration_s or AUTOTUNE_S, "an axis"),
    }


def _system_identification(
    procedure: Procedure,
    axis: str,
    excitation: Excitation,
    current: Mapping[str, float],
    axes: tuple[str, ...],
) -> dict[str, tuple[float, str]]:
    """The chirp; the integrator, which would fight its dwell; command shaping."""
    prefix = "Q_A" if procedure.name == "quadplane" else "ATC"
    made: dict[str, tuple[float, str]] = {}
    for name, option in SID_NAMES.items():
        asked = float(str(excitation.options[option]))
        # Three decimals, and three digits: of a small amplitude decimals alone left nothing.
        made[name] = (round(asked, 3) if asked >= LEAST_DECIMAL else float(f"{asked:.3g}"), "")
    made["SID_AXIS"] = (float(SID_AXES[axis]), f"at the mixer, {axis}")
    made[f"{prefix}_RATE_FF_ENAB"] = (0.0, "keeps command shaping out of the sweep")
    if procedure.kind == "multirotor":
        for each in (*axes, axis):
            name = f"{prefix}_RAT_{LETTERS[each]}_I"
            if each == axis:
                made[name] = (0.0, "for the sweep only: the integrator fights its slow part")
            elif name in current:
                made[name] = (current[name], f"as flown: the file of {each} had it at 0")
    return made


def _logging(procedure: Procedure, current: Mapping[str, float]) -> dict[str, tuple[float, str]]:
    """Bits that log fast enough; none where the present ones are not known (ArduPilot)."""
    if procedure.name.startswith("px4"):
        if current and "SDLOG_PROFILE" not in current:
            return {}  # firmware that has no such parameter
        present = int(current.get("SDLOG_PROFILE", 1))
        return {"SDLOG_PROFILE": (present | SDLOG_PROFILE, "system identification, high rate")}
    if procedure.name == "inav":
        without = dict.fromkeys(CONTROL_DERIVATIVES, (0.0, "for the sweep only"))
        return {**INAV_LOGGING, **without}
    if procedure.name == "betaflight" or not 0 <= current.get("LOG_BITMASK", -1) < 2**31:
        return {}
    bits = sum(2**bit for bit in LOG_BITS[log_family(procedure)])
    return {"LOG_BITMASK": (int(current["LOG_BITMASK"]) | bits, "fast attitude and outputs")}


def log_family(procedure: Procedure) -> str:
    """Whose numbering LOG_BITMASK has."""
    return "plane" if procedure.name in ("arduplane", "quadplane") else "copter"


INAV_LOGGING = {
    "blackbox_rate_num": (1.0, "every second loop"),
    "blackbox_rate_denom": (2.0, "every second loop"),
}
CONTROL_DERIVATIVES = ("mc_cd_roll", "mc_cd_pitch", "mc_cd_yaw")
BETAFLIGHT_CLI = """# flightid: chirp; save `diff all` first, it is the way back
set debug_mode = CHIRP
set blackbox_sample_rate = 1/2
set blackbox_high_resolution = ON
set blackbox_disable_debug = OFF
set chirp_lag_freq_hz = 3
set chirp_lead_freq_hz = 30
{chirp}
set f_roll = 0
set f_pitch = 0
set f_yaw = 0
save
"""
"""Feed-forward off; lag and lead are Betaflight's own."""
CHIRP_BAND_RAD_S, CHIRP_S = (math.tau * 0.2, math.tau * 200.0), 20.0
CHIRP_DEG_S = {"roll": 230.0, "pitch": 230.0, "yaw": 180.0}
"""Betaflight's defaults for a 5-inch quadrotor."""


def _chirp(axis: str, asked: PlanOptions) -> dict[str, tuple[float, str]]:
    """Betaflight's sweep of the rate set-point."""
    band = asked.band_rad_s or CHIRP_BAND_RAD_S
    size = CHIRP_DEG_S[axis] if asked.amplitude is None else math.degrees(asked.amplitude)
    return {
        f"chirp_amplitude_{axis}": (round(size), "deg/s, before the lag"),
        "chirp_frequency_start_deci_hz": (round(10.0 * band[0] / math.tau), "0.1 Hz"),
        "chirp_frequency_end_deci_hz": (round(10.0 * band[1] / math.tau), "0.1 Hz"),
        "chirp_time_seconds": (round(asked.duration_s or CHIRP_S), "s, an axis"),
    }


def betaflight_cli(changes: Iterable[GainChange]) -> str:
    """Lines for Betaflight's CLI that make the chirp of all axes."""
    wanted = {each.name: int(each.value) for each in changes}
    return BETAFLIGHT_CLI.format(
        chirp="\n".join(f"set {name} = {value}" for name, value in wanted.items())
    )


def unsized_s(procedure: Procedure, asked: PlanOptions) -> float:
    """Length of a sweep that the autopilot makes by itself, s."""
    return asked.duration_s or (CHIRP_S if procedure.how == "chirp" else AUTOTUNE_S)
