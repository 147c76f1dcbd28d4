"""Notches on the motors that could be switched on, by what the spectrum and the log tell."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from flightid.control.autopilots import AXES, AxisLoop, GainChange, NotchTracking, notch_tracking
from flightid.control.autopilots.gyro_notches import ardupilot_notches, px4_notches
from flightid.inspection.signals import Span
from flightid.logs import Log
from flightid.review.gyro_noise import (
    FALLS,
    LOWEST_HZ,
    MOVES,
    STANDING_OUT,
    GyroNoise,
    floor_beneath,
)

NEAR = 0.06
"""Of a frequency: a harmonic of the motors, or a notch on a peak."""
MOTORS = ("motors turn", "two blades", "three blades", MOVES, FALLS)
HARMONICS = 3
USUAL_WIDTH = 0.5
"""Of the base frequency, as ArduPilot's documentation advises."""
LEAST_WIDTH_HZ = 20.0
LOWEST_RATIO = 0.7
"""FM_RAT: how far below FREQ a notch may follow throttle."""


def proposed_notches(
    log: Log, spans: Sequence[Span], noise: GyroNoise, flown: Mapping[str, AxisLoop]
) -> Iterator[tuple[list[GainChange], dict[str, AxisLoop]]]:
    """Parameters of notches on the motors' peaks, and the loops with them; none where some are on.

    Parameters
    ----------
    log : Log
    spans : sequence of tuple of float
        Where the vehicle flew.
    noise : GyroNoise
    flown : mapping of str to AxisLoop
        By axis.

    Reference
    ---------
    ArduPilot, Copter documentation, *Managing Gyro Noise with the Dynamic Harmonic Notch*; PX4
    guide, *MC Filter Tuning*.
    """
    motors = any(peak.source.startswith(MOTORS) for peak in noise.peaks)
    if not motors or any(loop.gyro_notches for loop in flown.values()):
        return
    tracking = notch_tracking(log, spans)
    px4 = log.kind == "px4"
    first, harmonics = _series(noise, tracking)
    values = _px4(first, tracking) if px4 else _ardupilot(first, harmonics, tracking)
    asked = {**log.parameters, **values}
    changes = [
        GainChange(name, value, log.parameters.get(name), "notch on the motors")
        for name, value in values.items()
        if log.parameters.get(name) != value
    ]
    loops = {}
    for axis, loop in flown.items():
        made = (
            px4_notches(asked, loop.gyro_rate_hz, tracking, AXES.index(loop.axis))
            if px4
            else ardupilot_notches(asked, loop.gyro_rate_hz, tracking)
        )
        loops[axis] = replace(loop, gyro_notches=made.sections)
    if changes and any(loop.gyro_notches for loop in loops.values()):
        yield changes, loops


def _series(noise: GyroNoise, tracking: NotchTracking) -> tuple[float, tuple[int, ...]]:
    """Lowest harmonic of the motors at the middle throttle, and which of its multiples stand out.

    All windows together smear a peak that moves; those of one throttle do not.
    """
    power = noise.spectrum.mean(axis=0)
    if noise.throttle.size and tracking.throttle is not None:
        power = noise.by_throttle[np.argmin(np.abs(noise.throttle - tracking.throttle.middle))]
    frequency = noise.frequency_hz
    height = power / floor_beneath(frequency, power)
    height[frequency < LOWEST_HZ] = 0.0

    def top(middle: float) -> float:
        near = np.abs(frequency - middle) <= NEAR * middle
        return float(height[near].max(initial=0.0))

    strongest = float(frequency[np.argmax(height)])
    below = [n for n in range(HARMONICS, 1, -1) if top(strongest / n) > STANDING_OUT**2]
    first = strongest / below[0] if below else strongest
    found = [n for n in range(1, HARMONICS + 1) if top(n * first) > STANDING_OUT**2]
    return first, tuple(found)


def _ardupilot(first: float, harmonics: Sequence[int], tracking: NotchTracking) -> dict[str, float]:
    """By the speed controllers' telemetry where the log has it, else by throttle."""
    mask = sum(1 << (number - 1) for number in harmonics)
    shared = {"ENABLE": 1.0, "ATT": 40.0, "HMNCS": float(mask)}
    if tracking.motors:
        least = min(motor.low for motor in tracking.motors)
        own = {"MODE": 3.0, "REF": 1.0, "FREQ": float(round(least)), "FM_RAT": 1.0}
    elif tracking.throttle is not None:
        reference = round(tracking.throttle.middle, 3)
        own = {"MODE": 1.0, "REF": reference, "FREQ": float(round(first)), "FM_RAT": LOWEST_RATIO}
    else:
        return {}
    own["BW"] = float(round(USUAL_WIDTH * own["FREQ"]))
    return {f"INS_HNTCH_{name}": value for name, value in (shared | own).items()}


def _px4(first: float, tracking: NotchTracking) -> dict[str, float]:
    """By telemetry where the log has it, else a fixed notch on the lowest peak."""
    if tracking.motors:
        return {"IMU_GYRO_DNF_EN": 1.0}
    width = float(max(round(0.2 * first), LEAST_WIDTH_HZ))
    return {"IMU_GYRO_NF0_FRQ": float(round(first)), "IMU_GYRO_NF0_BW": width}
