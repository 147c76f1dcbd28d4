"""Whether counts of a decoded blackbox are ten times as fine, where no header says so.

Firmware with ``blackbox_high_resolution`` multiplies sticks, set-points and rates by ten before it
writes them, and only the header tells. Throttle and sticks have limits of their own in every
firmware, so their counts tell it too. ``blackbox_decode --unit-rotation`` multiplies rates by
``gyro_scale`` alone: what it calls deg/s is ten times as large in such a log.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flightid.frozen import dataclass
from flightid.logs.blackbox.firmware import REVISION
from flightid.logs.blackbox.stick_rates import FASTEST_DEG_S, FULL_STICK
from flightid.logs.table_source import Array

FLAG = "blackbox_high_resolution"
THROTTLE_STICK, THROTTLE = "rcCommand[3]", "setpoint[3]"
STICK_RANGE, FULL_THROTTLE, FLOWN_THROTTLE = (800.0, 2200.0), 1000.0, 300.0
"""µs of a throttle stick; counts of full throttle; those below which nothing is said: a flight of
counts ten times as fine would be one at 3 % of full throttle."""
BEYOND = 1.1
"""Times a limit from which counts are finer: rounding and trims reach past it."""
SAME_COUNTS = float(np.sqrt(0.1))
"""Rates over set-points, by spread, above which both have the same counts: 1 or a tenth."""


@dataclass(frozen=True)
class Resolution:
    """What the counts of sticks, set-points and rates are, and what tells it.

    Attributes
    ----------
    is_fine : bool or None
        Whether they are ten times as fine; None where nothing tells.
    sign : str
        What tells it, in words; empty where the header does, or nothing.
    """

    is_fine: bool | None
    sign: str = ""


def resolution_of(header: Mapping[str, str], columns: Mapping[str, Array]) -> Resolution:
    """Resolution by the header, else by the limits of sticks and throttle.

    Parameters
    ----------
    header : mapping of str to str
        Empty where there is none; a header without the flag is of firmware before 4.3.
    columns : mapping of str to ndarray
        Counts as they were logged.

    Reference
    ---------
    Betaflight, src/main/blackbox/blackbox.c, loadMainState: what is scaled; rc.c: its limits.

    Example
    -------
    >>> resolution_of({}, {"rcCommand[3]": np.array([10_000.0, 14_210.0])}).is_fine
    True
    >>> resolution_of({}, {"rcCommand[3]": np.array([1000.0, 1421.0])}).sign
    'the throttle stick counts from 1,000 to 1,421'
    """
    if FLAG in header:
        return Resolution(header[FLAG] == "1")
    found = _of_throttle_stick(columns) or _of_limits(columns) or _of_throttle(columns)
    if found is not None:
        return found
    return Resolution(False if REVISION in header else None)


def _ends(columns: Mapping[str, Array], name: str) -> tuple[float, float] | None:
    values = columns.get(name)
    if values is None or not np.any(np.isfinite(values)):
        return None
    return float(np.nanmin(values)), float(np.nanmax(values))


def _of_throttle_stick(columns: Mapping[str, Array]) -> Resolution | None:
    """A throttle stick has 1,000 to 2,000 µs, and never 0."""
    ends = _ends(columns, THROTTLE_STICK)
    if ends is None:
        return None
    sign = f"the throttle stick counts from {ends[0]:,.0f} to {ends[1]:,.0f}"
    for times, is_fine in ((1.0, False), (10.0, True)):
        if ends[0] >= times * STICK_RANGE[0] and ends[1] <= times * STICK_RANGE[1]:
            return Resolution(is_fine, sign)
    return None


def _of_limits(columns: Mapping[str, Array]) -> Resolution | None:
    """Sticks end at 500, set-points at 1,998 deg/s, and throttle at 1,000."""
    limits = {f"rcCommand[{axis}]": FULL_STICK for axis in range(3)}
    limits |= {f"setpoint[{axis}]": FASTEST_DEG_S for axis in range(3)}
    for name, limit in {**limits, THROTTLE: FULL_THROTTLE}.items():
        ends = _ends(columns, name)
        if ends is not None and (most := max(map(abs, ends))) > BEYOND * limit:
            return Resolution(True, f"{name} counts to {most:,.0f}, and its limit is {limit:,.0f}")
    return None


def _of_throttle(columns: Mapping[str, Array]) -> Resolution | None:
    """Throttle that would be next to nothing if its counts were fine."""
    ends = _ends(columns, THROTTLE)
    if ends is None or ends[1] < FLOWN_THROTTLE:
        return None
    return Resolution(False, f"{THROTTLE} counts to {ends[1]:,.0f}, and its limit is 1,000")


def rates_count_as_set_points(columns: Mapping[str, Array], unit_deg_s: float) -> bool:
    """Whether rates that a decoder gave a unit are as large as the counts of set-points.

    Parameters
    ----------
    columns : mapping of str to ndarray
        Cells as they stand in the file.
    unit_deg_s : float
        deg/s of one of the rates, by the unit behind their name.

    Returns
    -------
    bool
        True too where no set-point moves: known decoders leave the ten in.
    """
    spreads = [
        (float(np.nanstd(columns[rate])) * unit_deg_s, float(np.nanstd(columns[set_point])))
        for rate, set_point in ((f"gyroADC[{axis}]", f"setpoint[{axis}]") for axis in range(3))
        if rate in columns and set_point in columns
    ]
    rate, asked = max(spreads, key=lambda each: each[1], default=(0.0, 0.0))
    return asked <= 0.0 or rate >= SAME_COUNTS * asked
