"""Names of Betaflight's command line for what a blackbox header lists under names of its own."""

from __future__ import annotations

from collections.abc import Mapping

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
"""Settings of the command line by the header's line that lists them."""


def settings_of(header: Mapping[str, str]) -> dict[str, float]:
    """Settings that are numbers, by the header's names and by those of the command line.

    A line with several numbers becomes ``rollPID[0]``, ``rollPID[1]``, … and ``p_roll``, ….

    Parameters
    ----------
    header : mapping of str to str
        Lines of the header.

    Reference
    ---------
    Betaflight, src/main/blackbox/blackbox.c (4.3 to 2025.12), cli/settings.c.

    Example
    -------
    >>> found = settings_of({"rollPID": "45,80,30", "looptime": "125"})
    >>> found["d_roll"], found["rollPID[2]"], found["looptime"]
    (30.0, 30.0, 125.0)
    """
    found: dict[str, float] = {}
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
            names = NAMES.get(line, ())
            if place < len(names):
                found[names[place]] = number
    return found


def loop_step_s(settings: Mapping[str, float]) -> float | None:
    """Time of one loop of the controller, s; None where the header does not tell it.

    Parameters
    ----------
    settings : mapping of str to float
        `looptime` is that of the gyro, in µs.
    """
    gyro_us = settings.get("looptime", 0.0)
    denominator = max(settings.get("pid_process_denom", 1.0), 1.0)
    return gyro_us * denominator / 1e6 if gyro_us > 0.0 else None
