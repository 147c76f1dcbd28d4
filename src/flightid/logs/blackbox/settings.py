"""Names of the command line for what a blackbox header lists under names of its own."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.logs.blackbox.firmware import REVISION, Firmware, firmware_of

_AXES = ("roll", "pitch", "yaw")
_GAINS = ("p", "i", "d")
NAMES = {
    **{f"{axis}PID": tuple(f"{gain}_{axis}" for gain in _GAINS) for axis in _AXES},
    "d_min": tuple(f"d_min_{axis}" for axis in _AXES),
    "d_max": tuple(f"d_max_{axis}" for axis in _AXES),
    "ff_weight": tuple(f"f_{axis}" for axis in _AXES),
    "gyro_lpf1_dyn_hz": ("gyro_lpf1_dyn_min_hz", "gyro_lpf1_dyn_max_hz"),
    "dterm_lpf1_dyn_hz": ("dterm_lpf1_dyn_min_hz", "dterm_lpf1_dyn_max_hz"),
    "gyro_notch_hz": ("gyro_notch1_hz", "gyro_notch2_hz"),
    "gyro_notch_cutoff": ("gyro_notch1_cutoff", "gyro_notch2_cutoff"),
}
"""Settings of Betaflight's command line by the header's line that lists them."""
OLDER = {
    "feedforward_weight": tuple(f"f_{axis}" for axis in _AXES),
    "gyro_lowpass_hz": ("gyro_lpf1_static_hz",),
    "gyro_lowpass_type": ("gyro_lpf1_type",),
    "gyro_soft_type": ("gyro_lpf1_type",),
    "gyro_lowpass_dyn_hz": NAMES["gyro_lpf1_dyn_hz"],
    "gyro_lowpass2_hz": ("gyro_lpf2_static_hz",),
    "gyro_lowpass2_type": ("gyro_lpf2_type",),
    "dterm_lpf_hz": ("dterm_lpf1_static_hz",),
    "dterm_lowpass_hz": ("dterm_lpf1_static_hz",),
    "dterm_filter_type": ("dterm_lpf1_type",),
    "dterm_lowpass_dyn_hz": NAMES["dterm_lpf1_dyn_hz"],
    "dterm_lowpass2_hz": ("dterm_lpf2_static_hz",),
    "dterm_filter2_type": ("dterm_lpf2_type",),
    "yaw_lpf_hz": ("yaw_lowpass_hz",),
    "gyro_rpm_notch_harmonics": ("rpm_filter_harmonics",),
    "gyro_rpm_notch_q": ("rpm_filter_q",),
    "gyro_rpm_notch_min": ("rpm_filter_min_hz",),
    "dtermSetpointWeight": ("dterm_setpoint_weight",),
    "d_setpoint_weight": ("dterm_setpoint_weight",),
    "setpointRelaxRatio": ("setpoint_relax_ratio",),
}
"""The same, of headers before Betaflight 4.3."""
NEWER = (4, 3)
"""Version of Betaflight from which settings have their names of today."""
VERSION = "firmware_version"
"""Name of the version among the settings: 4.05 is 4.5. Before, controllers differed."""
OF_INAV = {
    **{
        f"{axis}PID": (*(f"mc_{gain}_{axis}" for gain in _GAINS), f"mc_cd_{axis}") for axis in _AXES
    },
    "levelPID": tuple(f"mc_{gain}_level" for gain in _GAINS),
    "gyro_lpf_hz": ("gyro_main_lpf_hz",),
}
"""The same of INAV's multicopters; names that are not here are those of its command line."""


def settings_of(header: Mapping[str, str]) -> dict[str, float]:
    """Settings that are numbers, by the header's names and by those of the command line.

    A line with several numbers becomes ``rollPID[0]``, ``rollPID[1]``, … and ``p_roll``, … or, of
    INAV, ``mc_p_roll``, …. Names of Betaflight's command line are those since 4.3; `VERSION` is the
    firmware's own.

    Parameters
    ----------
    header : mapping of str to str
        Lines of the header.

    Reference
    ---------
    Betaflight, src/main/blackbox/blackbox.c (3.0 to 2025.12), cli/settings.c; INAV,
    src/main/blackbox/blackbox.c, fc/settings.yaml (3 to 9).

    Example
    -------
    >>> found = settings_of({"rollPID": "45,80,30", "looptime": "125"})
    >>> found["d_roll"], found["rollPID[2]"], found["looptime"]
    (30.0, 30.0, 125.0)
    >>> settings_of({"Firmware revision": "INAV 7.1.2", "rollPID": "40,75,25,60"})["mc_cd_roll"]
    60.0
    """
    firmware = firmware_of(header.get(REVISION, ""))
    known, found = _names(firmware), dict[str, float]()
    if firmware.name:
        found[VERSION] = round(firmware.version[0] + firmware.version[1] / 100.0, 2)
    for line, value in header.items():
        if line.startswith("Field "):
            continue
        parts = value.split(",")
        for place, part in enumerate(parts):
            try:
                number = float(part)
            except ValueError:
                continue
            found[line if len(parts) == 1 else f"{line}[{place}]"] = number
            names = known.get(line, ())
            if place < len(names):
                found[names[place]] = number
    return found


def _names(firmware: Firmware) -> Mapping[str, tuple[str, ...]]:
    if firmware.is_inav:
        return OF_INAV
    is_older = bool(firmware.name) and firmware.version < NEWER
    return {**NAMES, **OLDER} if is_older else NAMES


def loop_step_s(settings: Mapping[str, float]) -> float | None:
    """Time of one loop of the controller, s; None where the header does not tell it.

    Parameters
    ----------
    settings : mapping of str to float
        `looptime` is that of the gyro, in µs; of INAV, that of the controller itself.
    """
    gyro_us = settings.get("looptime", 0.0)
    several = settings.get("pid_process_denom")
    denominator = 1.0 if several is None else max(several, 1.0)
    return gyro_us * denominator / 1e6 if gyro_us > 0.0 else None
