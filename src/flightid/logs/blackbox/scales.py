"""What one count of each field of a blackbox is worth, by its header."""

from __future__ import annotations

import struct
from collections.abc import Mapping

import numpy as np

from flightid.logs.blackbox.firmware import BETAFLIGHT, REVISION, Firmware, firmware_of
from flightid.logs.blackbox.settings import settings_of

GRAVITY = "acc_1G"
HIGH_RESOLUTION = 10.0
"""Counts to one of the usual size where headers say that resolution is high."""
RATES = ("gyroADC[", "gyroUnfilt[", "gyroRaw[")
FINE = (*RATES, "setpoint[", "rcCommand[")
"""Fields that ``blackbox_high_resolution`` stores ten times as fine."""
FORCES, VOLTAGE, CURRENT = "accSmooth[", "vbatLatest", "amperageLatest"
BATTERY = {(4, 0): (0.01, 0.01), (3, 2): (0.1, 0.01), (3, 1): (0.1, None)}
"""V and A of one count since a version of Betaflight, the newest first; before: raw readings."""
INAV_BATTERY = ((2, 0), 0.01, ("vbat", "amperage"))
"""Since that version of INAV a count is so many V and A, in these fields."""


def scales_of(
    header: Mapping[str, str], *, is_inav: bool = False
) -> tuple[dict[str, float], dict[str, str]]:
    """Factor by the beginning of a field's name; of fields without one, what the header lacks.

    Parameters
    ----------
    header : mapping of str to str
    is_inav : bool
        Whether it is INAV's, where the header does not say so.
    """
    fine = 1.0 / HIGH_RESOLUTION if header.get("blackbox_high_resolution") == "1" else 1.0
    gyro, gravity = _gyro_scale(header), settings_of(header).get(GRAVITY, 0.0)
    firmware = firmware_of(header.get(REVISION, ""))
    volts, amperes = _battery_scales(firmware)
    told = {
        **dict.fromkeys(RATES, ("gyro_scale", gyro and gyro * fine)),
        FORCES: (GRAVITY, 1.0 / gravity if gravity > 0.0 else None),
        VOLTAGE: ("version of Betaflight that logs volts", volts),
        CURRENT: ("version of Betaflight that logs amperes", amperes),
    }
    if is_inav or firmware.is_inav:
        since, count, fields = INAV_BATTERY
        known = count if firmware.version >= since else None
        told |= dict.fromkeys(fields, ("version of INAV from 2 on", known))
    scales = dict.fromkeys(FINE, fine)
    scales |= {name: scale for name, (_, scale) in told.items() if scale is not None}
    return scales, {name: lacks for name, (lacks, scale) in told.items() if scale is None}


def _battery_scales(firmware: Firmware) -> tuple[float | None, float | None]:
    if firmware.name != BETAFLIGHT:
        return None, None
    found = (each for since, each in BATTERY.items() if firmware.version >= since)
    return next(found, (None, None))


def _gyro_scale(header: Mapping[str, str]) -> float | None:
    """Degrees per second of one count: the bits of a float, in hexadecimal."""
    text = header.get("gyro_scale", header.get("gyro.scale", ""))
    try:
        scale = struct.unpack(">f", bytes.fromhex(text.removeprefix("0x").rjust(8, "0")))[0]
    except (ValueError, struct.error):
        return None
    if not (np.isfinite(scale) and scale > 0.0):
        return None
    # Baseflight counts in rad/µs.
    return float(np.degrees(scale * 1e6)) if scale < 1e-6 else float(scale)
