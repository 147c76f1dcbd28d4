"""Filters to tune with: those that the noise of the flight allows, or why there are none."""

from __future__ import annotations

from collections.abc import Collection

from flightid.control.autopilots import AXES
from flightid.control.tuning.filter_choice import BEYOND, FilterChoice
from flightid.inspection.actuators import find_actuators
from flightid.inspection.flight_phases import flight_phases
from flightid.logs import Log
from flightid.review.filters import filter_review
from flightid.review.gyro_noise import gyro_noise
from flightid.review.loops import loop_responses

ENOUGH = 0.9
"""Of half the loop's rate: a spectrum that ends there tells all that reaches the controller."""


def suggested_filters(log: Log, tuned: Collection[str]) -> tuple[FilterChoice | None, str]:
    """Filters for the gyro's noise in a log; None and a sentence where it does not tell enough.

    Parameters
    ----------
    log : Log
    tuned : collection of str
        Axes whose gains are tuned with them; the others may lose no phase.
    """
    spans = flight_phases(log, find_actuators(log)).airborne
    noise = gyro_noise(log, spans)
    left = [axis for axis in AXES if axis not in tuned]
    found = filter_review(log, spans, noise, loop_responses(log, spans), keep_phase=left)
    choice = found.choice
    if choice is None:
        return None, found.reason or noise.reason or "nothing was flown"
    loop, known_hz = choice.loops["roll"], float(noise.frequency_hz[-1])
    enough = ENOUGH * 0.5 * loop.loop_rate_hz
    cutoff = loop.gains.get(loop.names.get("gyro_filter", ""), 0.0)
    if cutoff:
        enough = min(enough, BEYOND * cutoff)
    if known_hz < enough:
        return None, f"the log tells the gyro's noise up to {known_hz:.3g} Hz, {enough:.3g} needed"
    return choice, ""
