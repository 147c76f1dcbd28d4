"""What to fly so that a loop shows its step: how large, and in which mode."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flightid.inspection.signals import Span
from flightid.logs import Log
from flightid.review.identity import mode_spans
from flightid.review.loop_response import LoopResponse

QUICK_DEG = 10.0, 20.0
"""Stick moves that tell the loop of an attitude."""
BY_RATES = "ACRO"
"""Mode of every autopilot in which sticks ask for rates: the angle's set-point is not theirs."""
BY_ANGLES = {
    ("ardupilot", "plane"): "FBWA",
    ("ardupilot", None): "STABILIZE",
    ("px4", None): "Stabilized mode",
    ("inav", None): "ANGLE",
    ("betaflight", None): "ANGLE",
}
"""Mode in which they ask for angles, by kind of log and vehicle; None: any other vehicle."""


def mode_to_fly(log: Log, loop: str, spans: Sequence[Span]) -> str:
    """Mode in which sticks would move the angle's set-point, where none of the flight was in one.

    Parameters
    ----------
    log : Log
    loop : str
        ``"rate"`` or ``"attitude"``.
    spans : sequence of tuple of float
        Where the vehicle flew, s.

    Returns
    -------
    str
        Empty where some of the flight was in another mode than by rates, and of rate loops.
    """
    if loop != "attitude":
        return ""
    flown = {
        each.mode
        for each in mode_spans(log)
        if any(each.start_s < stop and start < each.stop_s for start, stop in spans)
    }
    if flown != {BY_RATES}:
        return ""
    usual = BY_ANGLES.get((log.kind, None), "a mode in which sticks ask for angles")
    return BY_ANGLES.get((log.kind, log.vehicle), usual)


def what_to_fly(begun: LoopResponse) -> str:
    """What to fly so that this loop shows a step."""
    size, unit = _size_to_fly(begun)
    now = math.degrees(begun.moved or 0.0)
    where = f" in {begun.fly_in}" if begun.fly_in else ""
    return (
        f"fly a minute{where} with quick moves of the {begun.axis} stick, {size}, two a second at "
        f"most (the set-point's standard deviation was {now:.2g} {unit})"
    )


def _size_to_fly(begun: LoopResponse) -> tuple[str, str]:
    """Size of stick moves, no larger than the angle controller is proportional to, and its unit."""
    if begun.loop == "rate":
        return "30 to 60 deg/s to both sides", "deg/s"
    least, most = QUICK_DEG
    limit = math.inf if begun.proportional_rad is None else math.degrees(begun.proportional_rad)
    if limit < least:
        return f"to both sides by {limit:.2g} deg at once, or less", "deg"
    return f"{least:g} to {min(most, limit):.2g} deg to both sides", "deg"
