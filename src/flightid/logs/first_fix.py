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
        row = int(np.argmax(table["GWk"] > 0))
        # Milliseconds of the week, with a multiplier where the log declares one.
        unit = "ms" if table.unit("GMS") == DIMENSIONLESS else table.unit("GMS")
        of_week_s = float(convert(table["GMS"][row], unit, "s"))
        week = float(table["GWk"][row])
        since = datetime.timedelta(weeks=week, seconds=of_week_s - LEAP_S)
        return float(table.time_s[row]), GPS_EPOCH + since if 0 < week < 1e5 else None
    for topic, column in UNIX_GPS:
        if topic in log and column in log.messages[topic].fields:
            table = log.table(topic)
            row = int(np.argmax(table[column] > 0))
            at = float(table[column][row])
            begin = datetime.datetime(1970, 1, 1)
            good = 0 < at < 1e17
            fix = begin + datetime.timedelta(microseconds=at) if good else None
            return float(table.time_s[row]), fix
    return 0.0, None
