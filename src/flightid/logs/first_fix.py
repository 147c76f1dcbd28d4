"""When a log began: by its first fix of a satellite receiver that has a date."""

from __future__ import annotations

import datetime

import numpy as np

from flightid.errors import FlightidError
from flightid.logs.log import Log
from flightid.units import DIMENSIONLESS, convert

GPS_EPOCH = datetime.datetime(1980, 1, 6)
"""Begin of the weeks that GPS counts (IS-GPS-200)."""
LEAP_S = 18
"""GPS time before UTC since 2017, s."""
UNIX_EPOCH = datetime.datetime(1970, 1, 1)
"""Begin of the microseconds that PX4 logs."""
LAST_WEEK, LAST_US = 1e5, 1e17
"""Weeks and microseconds beyond which they are damage, and no calendar's."""
UNIX_GPS = (("vehicle_gps_position", "time_utc_usec"), ("sensor_gps", "time_utc_usec"))


def log_start(log: Log) -> datetime.datetime | None:
    """Start of a log by its first fix with a date, UTC; None where it has none.

    Parameters
    ----------
    log : Log
    """
    try:
        at_s, fix = _fix(log)
    except (FlightidError, IndexError):
        return None
    if fix is None or log.first_s is None:
        return None
    return (fix - datetime.timedelta(seconds=at_s - log.first_s)).replace(microsecond=0)


def _fix(log: Log) -> tuple[float, datetime.datetime | None]:
    if "GPS" in log and {"GWk", "GMS"} <= set(log.messages["GPS"].fields):
        table = log.table("GPS")
        row = int(np.flatnonzero(table["GWk"] > 0)[0])
        # Milliseconds of the week, with a multiplier where the log declares one.
        unit = "ms" if table.unit("GMS") == DIMENSIONLESS else table.unit("GMS")
        of_week_s = float(convert(table["GMS"][row], unit, "s"))
        week = float(table["GWk"][row])
        if week >= LAST_WEEK:
            return 0.0, None
        since = datetime.timedelta(weeks=week, seconds=of_week_s - LEAP_S)
        return float(table.time_s[row]), GPS_EPOCH + since
    for topic, column in UNIX_GPS:
        if topic in log and column in log.messages[topic].fields:
            table = log.table(topic)
            row = int(np.flatnonzero(table[column] > 0)[0])
            at = float(table[column][row])
            if at >= LAST_US:
                return 0.0, None
            return float(table.time_s[row]), UNIX_EPOCH + datetime.timedelta(microseconds=at)
    return 0.0, None
