"""Units of fields: the labels of unit tables, and what older firmware left undeclared."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from flightid.logs.dataflash.layout import standard_tables

# The labels of ArduPilot's unit table (AP_Logger/LogStructure.h) in flightid's spelling.
UNITS = {
    "": "1", "UNKNOWN": "1", "instance": "1", "satellites": "1", "%": "%", "ppm": "ppm",
    "A": "A", "Ah": "A*h", "A.s": "A*s", "W": "W", "Watt": "W", "W.h": "h*W", "W.s": "s*W",
    "J": "J", "V": "V", "Ohm": "Ω", "mV": "mV", "B": "B", "B/s": "B/s", "deg": "deg",
    "deglatitude": "deg", "deglongitude": "deg", "degheading": "deg", "deg/s": "deg/s",
    "deg/s/s": "deg/s^2", "rad": "rad", "rad/s": "rad/s", "rad/s/s": "rad/s^2", "m": "m",
    "m/s": "m/s", "m/s/s": "m/s^2", "degC": "°C", "s": "s", "us": "µs", "Hz": "Hz",
    "rpm": "rpm", "l": "l", "l/s": "l/s", "N.m": "m*N", "Pa": "Pa", "Gauss": "G", "mGauss": "mG",
}  # fmt: skip
UNDECLARED = ("RATE", "ATT", "ANG", "IMU", "AHR2")
"""Messages whose fields hold, in logs without unit tables, what newer firmware declares."""
ATTITUDE = {"Roll": "deg", "Pitch": "deg", "Yaw": "deg"}
DEGREES_SINCE = (3, 4)
"""ArduCopter since when RATE holds deg/s, and commands to 1; before, hundredths, and to 4500."""


@cache
def undeclared_units(name: str) -> Mapping[str, str]:
    """Units of the fields of a message that are stored unscaled, from the newest firmware."""
    units, _, layouts = standard_tables()
    layout = layouts.get(name)
    if layout is None:
        return ATTITUDE
    fields = zip(layout.labels, layout.units, layout.multipliers, strict=True)
    unscaled = ((label, units[unit]) for label, unit, multiplier in fields if multiplier in "-0?")
    return {label: UNITS[unit] for label, unit in unscaled}
