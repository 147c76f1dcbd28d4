"""Names for the numbers that PX4 logs, from its message definitions and MAVLink's enumerations."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.logs.source import Event

LEVELS = {
    0: "emergency",
    1: "alert",
    2: "critical",
    3: "error",
    4: "warning",
    5: "notice",
    6: "info",
    7: "debug",
}
"""Severity of a logged line; the log writes the digit as a character."""

MODES = {
    0: "MANUAL",
    1: "ALTCTL",
    2: "POSCTL",
    3: "AUTO_MISSION",
    4: "AUTO_LOITER",
    5: "AUTO_RTL",
    10: "ACRO",
    12: "DESCEND",
    13: "TERMINATION",
    14: "OFFBOARD",
    15: "STAB",
    17: "AUTO_TAKEOFF",
    18: "AUTO_LAND",
    19: "AUTO_FOLLOW_TARGET",
    20: "AUTO_PRECLAND",
    21: "ORBIT",
}
"""vehicle_status.nav_state."""

ARMED = {0: "init", 1: "disarmed", 2: "armed", 3: "armed with error", 4: "disarmed with error"}
"""vehicle_status.arming_state; newer firmware uses 1 and 2 only."""

VEHICLE_TYPES = {1: "copter", 2: "plane", 3: "rover"}
"""vehicle_status.vehicle_type: rotary wing, fixed wing, rover."""

AIRFRAMES = {
    1: "plane",
    2: "copter",
    3: "copter",
    4: "heli",
    10: "rover",
    13: "copter",
    14: "copter",
    15: "copter",
}
"""MAV_TYPE of MAVLink."""


def changes_of(
    values: NDArray[np.int64],
    time_s: NDArray[np.float64],
    field: str,
    kind: str,
    names: Mapping[int, str],
) -> list[Event]:
    """An event for each value that differs from the one before, the first included.

    Parameters
    ----------
    values, time_s : ndarray, shape (n,)
    field, kind : str
        Field of the message, and kind of the events.
    names : mapping of int to str
        Words of the values.
    """
    return [
        Event(float(time_s[at]), kind, names.get(int(values[at]), f"{field} {values[at]}"))
        for at in starts_of(values)
    ]


def starts_of(values: NDArray[np.int64] | NDArray[np.bool_]) -> NDArray[np.intp]:
    """Where a value differs from the one before; the first place among them.

    Example
    -------
    >>> starts_of(np.array([3, 3, 1, 1, 3])), starts_of(np.empty(0, int))
    (array([0, 2, 4]), array([], dtype=int64))
    """
    differs = np.ones(values.shape, np.bool_)
    np.not_equal(values[1:], values[:-1], out=differs[1:])
    return np.flatnonzero(differs)
