"""Vibration as the autopilot measures it, against the limits that its makers publish."""

from __future__ import annotations

import numpy as np

from flightid.frozen import dataclass
from flightid.inspection.signals import Span, inside
from flightid.inspection.stamps import believable
from flightid.inspection.thresholds import Threshold
from flightid.logs import Log
from flightid.review.thresholds import (
    PX4_VIBRATION_BAD,
    PX4_VIBRATION_GOOD,
    VIBE_BAD,
    VIBE_GOOD,
)

UPPER = 99.0
"""Percentile that stands for the largest: one knock is no vibration."""
PX4 = ("vehicle_imu_status", "accel_vibration_metric")
CLIPPING = tuple(f"accel_clipping[{axis}]" for axis in range(3))


@dataclass(frozen=True)
class Vibration:
    """Level of one measure of one sensor in the air.

    Attributes
    ----------
    name : str
        Where it is logged.
    median, high : float
        Median and 99th percentile, m/s².
    good, bad : Threshold
        Limits of the autopilot's makers: below the first is fine, above the second is trouble.
    clipped : int or None
        Samples of the accelerometer at its range; None where they are not counted.
    """

    name: str
    median: float
    high: float
    good: Threshold
    bad: Threshold
    clipped: int | None


def vibrations(log: Log, spans: tuple[Span, ...]) -> tuple[Vibration, ...]:
    """Vibration of every sensor in the air; empty where it is not logged."""
    if log.kind == "px4":
        return _measures(
            log, spans, PX4[0], (PX4[1],), CLIPPING, PX4_VIBRATION_GOOD, PX4_VIBRATION_BAD
        )
    fields = ("VibeX", "VibeY", "VibeZ")
    return _measures(log, spans, "VIBE", fields, ("Clip",), VIBE_GOOD, VIBE_BAD)


def _measures(
    log: Log,
    spans: tuple[Span, ...],
    message: str,
    fields: tuple[str, ...],
    counters: tuple[str, ...],
    good: Threshold,
    bad: Threshold,
) -> tuple[Vibration, ...]:
    if message not in log:
        return ()
    info, found = log.messages[message], []
    for instance in info.instances or (None,):
        table = log.table(message, instance)
        mask = inside(table.time_s, spans) & believable(table.time_s)
        if np.count_nonzero(mask) < 2:
            continue
        label = message if instance is None else f"{message}[{instance}]"
        counted = [table[name][mask] for name in counters if name in table]
        clipped = round(sum(float(c[-1] - c[0]) for c in counted)) if counted else None
        for field in (field for field in fields if field in table):
            values = table[field][mask]
            values = values[np.isfinite(values)]
            if values.size:
                high = float(np.percentile(values, UPPER))
                found.append(
                    Vibration(
                        f"{label}.{field}", float(np.median(values)), high, good, bad, clipped
                    )
                )
    return tuple(found)
