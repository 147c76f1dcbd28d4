"""Steps of loops from flights by sticks alone: do intervals hold the simulator's own numbers."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cache, partial

import numpy as np

from flightid.errors import FlightidError
from flightid.review.deconvolution import LoopDraws, LoopSamples, closed_loop
from flightid.review.step_features import frequency_features, reached_features, step_features
from flightid.review.told_band import told_by, told_hz
from flightid.uncertainty.quantiles import tails
from tests.strangers.counting import Case, Reading, Trial
from tests.strangers.ordinary_flights import Axis, ordinary, step

WINDOW_S, SLOWEST_HZ, INSTANTS = 0.5, 2.0, 8
QUADROTOR = Axis()
PX4 = Axis(form="px4", p=0.15, i=0.2, d=0.003)
BETAFLIGHT = Axis(
    form="betaflight", loop_hz=1000.0, effectiveness=400.0, damping=4.0, motor_s=0.03,
    delay_ticks=2, p=0.06, i=0.1, d=0.0012, derivative_hz=80.0, gyro_hz=150.0, forward=0.0015,
    gust=8.0,
)  # fmt: skip
HELICOPTER = Axis(
    effectiveness=60.0, damping=12.0, motor_s=0.06, p=0.1, i=0.15, d=0.0, angle_p=4.0, gust=2.0
)
PLANE = Axis(
    effectiveness=45.0, damping=8.0, motor_s=0.05, p=0.12, i=0.2, d=0.0, angle_p=2.5, gust=1.5
)
READ = (
    "level",
    "delay to half",
    "rise time",
    "overshoot",
    "bandwidth at -3 dB",
    "frequency at -90",
)


@cache
def truths(axis: Axis, every: int) -> tuple[dict[str, float | None], tuple[float, ...]]:
    """What is read off the quiet loop, at the instants of an estimate, and its step there."""
    ticks = step(axis, 3.0)
    time_s = instants(axis, every)
    exact = np.interp(time_s, np.arange(ticks.size) / axis.loop_hz, ticks)
    pulses = np.diff(np.concatenate([[0.0], ticks]))
    loop = LoopDraws(np.array([pulses, pulses]), np.ones((2, 1)), 1.0 / axis.loop_hz)
    read = reached_features(np.array([exact, exact]), time_s)
    read += frequency_features(loop, SLOWEST_HZ)
    return {r.name: r.value for r in read}, tuple(exact)


def instants(axis: Axis, every: int) -> np.ndarray:
    """When a step is told, s after the tick at which the set-point jumps."""
    sample_s = every / axis.loop_hz
    middles = (np.arange(round(WINDOW_S / sample_s)) + 0.5) * sample_s
    return np.asarray(middles - 0.5 / axis.loop_hz)


def fly_samples(
    seed: int, axis: Axis, *, acro: bool, duration_s: float = 60.0, every: int = 4
) -> LoopSamples:
    """What a log of one flight would hold of the rate loop."""
    flown = ordinary(axis, seed, duration_s, acro=acro, size=1.0 if acro else 0.25)
    sample_s = every / axis.loop_hz
    r, y, angle = flown.rate_wanted[::every], flown.rate[::every], flown.angle[::every]
    ahead = np.concatenate([[0.0], np.diff(angle) / sample_s])
    return LoopSamples(r - r.mean(), y - y.mean(), ahead - ahead.mean(), (r.size,), sample_s)


def fly_step(
    seed: int, *, axis: Axis, acro: bool, duration_s: float = 60.0, every: int = 4
) -> Trial:
    """Step at eight instants and every reading of one flight's rate loop."""
    samples = fly_samples(seed, axis, acro=acro, duration_s=duration_s, every=every)
    begun = time.perf_counter()
    try:
        loop = closed_loop(samples)
    except FlightidError as error:
        return Trial(refusal=str(error), seconds=time.perf_counter() - begun)
    time_s = instants(axis, every)
    steps = loop.step(time_s.size)
    known, exact = truths(axis, every)
    low, high = np.quantile(steps[1:], tails(0.95), axis=0)
    readings = [
        Reading(f"step at {1e3 * time_s[k]:.0f} ms", exact[k], float(steps[0, k]), None, ends)
        for k in np.linspace(2, time_s.size - 1, INSTANTS).round().astype(int)
        for ends in [(float(low[k]), float(high[k]))]
    ]
    features = (*step_features(steps, time_s), *frequency_features(loop, SLOWEST_HZ))
    for found in told_by(features, told_hz(samples)):
        truth = known[found.name]
        if found.name.startswith(READ) and truth is not None and found.value is not None:
            readings.append(Reading(found.name, truth, found.value, None, found.interval95))
    return Trial(tuple(readings), "", time.perf_counter() - begun)


CASES = tuple(
    Case(f"ordinary flight, {name}", partial(fly_step, axis=axis, acro=acro, **extra))
    for name, axis, acro, extra in (
        ("quadrotor, ArduPilot, angle mode", QUADROTOR, False, {}),
        ("quadrotor, ArduPilot, acro", QUADROTOR, True, {}),
        ("quadrotor, PX4, angle mode", PX4, False, {}),
        ("quadrotor, PX4, acro, 50 Hz", PX4, True, {"every": 8}),
        ("quadrotor, Betaflight, acro", BETAFLIGHT, True, {"every": 4}),
        ("helicopter, angle mode", HELICOPTER, False, {}),
        ("plane, angle mode", PLANE, False, {}),
        ("quadrotor, calm", replace(QUADROTOR, gust=0.5), False, {}),
        ("helicopter, heavy gusts", replace(HELICOPTER, gust=6.0), False, {}),
    )
)
