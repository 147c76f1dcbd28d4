"""When the vehicle flew: airborne spans, and what must be rejected after a tip-over."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.actuators import Actuators
from flightid.inspection.advice import cut_short, whole_log
from flightid.inspection.signals import Signal, Span, find
from flightid.inspection.stamps import believable, log_span
from flightid.inspection.thresholds import (
    AIRBORNE_SHARE,
    AIRBORNE_SPEED,
    AIRBORNE_THRUST,
    GAP_FACTOR,
    LYING_RATE,
    LYING_TILT,
    SHORTEST_SEGMENT,
    TIPPING_TILT,
)
from flightid.logs import Log

EV_LAND_COMPLETE, EV_NOT_LANDED = 18, 28
"""Ids of ArduPilot's EV message."""
FALL_S = 5.0
"""A fall begins at most this long after the throttle went down, s."""
GRID_S, MOST_ON_GRID = 0.1, 1_000_000
"""Step in which states are told that last until the next one, s, and the most such steps."""


@dataclass(frozen=True)
class FlightPhases:
    """Where in a log the vehicle flew.

    Attributes
    ----------
    airborne : tuple of (float, float)
        Spans in the air, s, on the autopilot's clock; a fall is not part of them.
    motors_ran : bool or None
        Whether any motor was ever commanded above its lower limit; None where none is logged.
    tipped_s : float or None
        When the vehicle began to fall over; None where it did not.
    evidence : str
        What the spans rest on.
    is_known : bool
        Whether the log holds anything that tells flight from ground.
    action : str
        What to log where it does not.
    """

    airborne: tuple[Span, ...]
    motors_ran: bool | None
    tipped_s: float | None
    evidence: str
    is_known: bool = True
    action: str = ""

    @property
    def fall(self) -> str:
        """When it fell, in words; empty where it did not."""
        if self.tipped_s is None:
            return ""
        return f"the vehicle falls over at {self.tipped_s:.1f} s of the autopilot's clock"

    @property
    def airborne_s(self) -> float:
        """Time in the air, s."""
        return sum(stop - start for start, stop in self.airborne)

    @property
    def airborne_words(self) -> str:
        """Time in the air with its unit, or that it is not known."""
        return f"{self.airborne_s:.1f} s" if self.is_known else "not known"


def flight_phases(log: Log, actuators: Actuators | None) -> FlightPhases:
    """Find the airborne spans of a log from throttle (or speed), landing detector and attitude.

    Where neither throttle nor speed is logged the motors' commands stand in for the throttle, or
    the landing detector alone tells.
    """
    ran = None if actuators is None else actuators.ran
    if ran is False:
        return FlightPhases((), ran, None, "motor outputs")
    plane = log.vehicle == "plane"
    carrying = find(log, "airspeed" if plane else "thrust") or _mean_motor(log, actuators)
    flying = landing_detector(log)
    if carrying is None and flying is None:
        return _untold(log, ran)
    spans, evidence, tipped = [(-np.inf, np.inf)], [], None
    if carrying is not None:
        limit = AIRBORNE_SPEED.value if plane else _carrying_throttle(carrying.values)
        spans = _spans(carrying.time_s, carrying.values > limit)
        evidence.append(f"{carrying.label} above {limit:.3g} {carrying.unit}".removesuffix(" 1"))
        tipped = _tip_over(log, carrying, limit)
    if flying is not None:
        spans = _common(spans, _spans(*flying))
        evidence.append("landing detector")
    if tipped is not None and not any(start < tipped < stop + FALL_S for start, stop in spans):
        # Moved by hand after landing.
        tipped = None
    if tipped is not None:
        spans = _common(spans, [(-np.inf, tipped)])
        evidence.append("attitude")
    kept = tuple(span for span in spans if span[1] - span[0] >= SHORTEST_SEGMENT.value)
    return FlightPhases(kept, ran, tipped, ", ".join(evidence))


def _untold(log: Log, ran: bool | None) -> FlightPhases:
    """That flight is not told from ground, why, and what to log for it."""
    if end := cut_short(log):
        reason, action = f"the log ends {end}", whole_log(end)
        return FlightPhases((), ran, None, reason, is_known=False, action=action)
    reason = "no throttle, motor output, speed or landing detector is logged"
    action = "log the throttle or the motors' outputs as well"
    if log.kind == "ardupilot":
        action = "log the throttle (CTUN) or the outputs (RCOU) with the parameters (PARM)"
    if "RCOU" in log:
        reason = (
            "outputs are logged (RCOU), but no SERVOn_FUNCTION says which of them are motors, and "
            "neither throttle, speed nor landing detector is logged"
        )
        action = "keep the beginning of the log, where the parameters are (PARM), or log CTUN"
    return FlightPhases((), ran, None, reason, is_known=False, action=action)


def _mean_motor(log: Log, actuators: Actuators | None) -> Signal | None:
    """Mean command of a multirotor's motors as a share of their range, in place of a throttle."""
    if actuators is None or log.vehicle == "plane" or actuators.time_s.size < 2:
        return None
    good = believable(actuators.time_s)
    mean = np.asarray(np.mean(actuators.values, axis=0, dtype=np.float64))[good]
    values = (mean - actuators.low) / (actuators.high - actuators.low)
    return Signal("thrust", actuators.time_s[good], values, "1", f"mean of {actuators.message}")


def _carrying_throttle(throttle: NDArray[np.float64]) -> float:
    used = throttle[throttle > AIRBORNE_THRUST.value]
    if used.size == 0:
        return AIRBORNE_THRUST.value
    return max(AIRBORNE_THRUST.value, AIRBORNE_SHARE.value * float(np.median(used)))


def _spans(time_s: NDArray[np.float64], mask: NDArray[np.bool_]) -> list[Span]:
    """Spans of true samples; interruptions shorter than the shortest segment count as true.

    A silence of the stream ends a span: nobody knows what the vehicle did in it.
    """
    longest = 0.5 * SHORTEST_SEGMENT.value
    if time_s.size > 1:
        steps = np.diff(time_s)
        usual = float(np.median(steps, overwrite_input=True))
        silent = np.flatnonzero(np.diff(time_s) > max(longest, GAP_FACTOR.value * usual)) + 1
        pieces = [slice(*ends) for ends in pairwise((0, *silent.tolist(), time_s.size))]
    else:
        pieces = [slice(None)]
    return [span for piece in pieces for span in _runs(time_s[piece], mask[piece], longest)]


def _runs(time_s: NDArray[np.float64], mask: NDArray[np.bool_], longest_s: float) -> list[Span]:
    edges = np.diff(mask.astype(np.int8), prepend=np.int8(0), append=np.int8(0))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    spans: list[Span] = []
    for start, stop in zip(time_s[starts], time_s[stops], strict=True):
        if spans and start - spans[-1][1] < longest_s:
            spans[-1] = (spans[-1][0], float(stop))
        else:
            spans.append((float(start), float(stop)))
    return spans


def _common(first: list[Span], second: list[Span]) -> list[Span]:
    both = [(max(a[0], b[0]), min(a[1], b[1])) for a in first for b in second]
    return [span for span in both if span[1] > span[0]]


def landing_detector(log: Log) -> tuple[NDArray[np.float64], NDArray[np.bool_]] | None:
    """Stamps and whether the autopilot held itself for flying; None where it does not log it."""
    if log.kind == "px4":
        name = "vehicle_land_detected"
        if name not in log or "landed" not in log.messages[name].fields:
            return None
        table = log.table(name, log.messages[name].instances[0])
        good = believable(table.time_s)
        return _held(log, table.time_s[good], table["landed"][good] == 0)
    if "EV" not in log:
        return None
    table = log.table("EV")
    told = np.isin(table["Id"], [EV_LAND_COMPLETE, EV_NOT_LANDED]) & believable(table.time_s)
    took_off = table["Id"][told] == EV_NOT_LANDED
    return _held(log, table.time_s[told], took_off) if np.any(took_off) else None


def _held(
    log: Log, time_s: NDArray[np.float64], flying: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]] | None:
    """States that last until the next one, on a grid of 0.1 s; before the first, its opposite."""
    if time_s.size == 0:
        return None
    first, last = log_span(log)
    grid = np.linspace(first, last, min(max(2, int((last - first) / GRID_S)), MOST_ON_GRID))
    index = np.searchsorted(time_s, grid, side="right") - 1
    return grid, np.where(index >= 0, flying[index], ~flying[0])


def tilt(log: Log) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Stamps, s, and angle of the z axis from the vertical, rad; None where not logged."""
    if log.kind == "px4":
        if "vehicle_attitude" not in log or "q[1]" not in log.messages["vehicle_attitude"].fields:
            return None
        table = log.table("vehicle_attitude", log.messages["vehicle_attitude"].instances[0])
        cosine = 1.0 - 2.0 * (table["q[1]"] ** 2 + table["q[2]"] ** 2)
        good = believable(table.time_s) & np.isfinite(cosine)
        return table.time_s[good], np.arccos(np.maximum(cosine[good], -1.0))
    phi, theta = find(log, "phi"), find(log, "theta")
    if phi is None or theta is None:
        return None
    pitch = np.interp(phi.time_s, theta.time_s, theta.values)
    return phi.time_s, np.arccos(np.cos(phi.values) * np.cos(pitch))


def _tip_over(log: Log, carrying: Signal, limit: float) -> float | None:
    """When the vehicle began to fall, if at the end it lies still and tilted without thrust."""
    found = tilt(log)
    if found is None or log.vehicle == "plane":
        return None
    time_s, angle = found
    speed = np.abs(np.gradient(angle, time_s)) if time_s.size > 2 else np.zeros_like(angle)
    idle = np.interp(time_s, carrying.time_s, carrying.values) < limit
    lying = (angle > LYING_TILT.value) & (speed < LYING_RATE.value) & idle
    rest = [span for span in _spans(time_s, lying) if span[1] - span[0] > 1.0]
    if not rest:
        return None
    upright = np.flatnonzero((time_s < rest[0][0]) & (angle < TIPPING_TILT.value))
    return float(time_s[upright[-1]]) if upright.size else float(time_s[0])
