"""Steps of loops from flights by sticks alone: do intervals hold the simulator's own numbers."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from flightid.review.deconvolution import LoopDraws
from flightid.review.loop_response import LoopResponse
from flightid.review.loop_samples import LoopSamples
from flightid.review.loops import SLOWEST_HZ, read_step
from flightid.review.step_features import frequency_features, window_features
from tests.strangers.counting import Case, Reading, Trial
from tests.strangers.ordinary_flights import HAND_S, Axis, ordinary, step

Array = NDArray[np.float64]
INSTANTS = 8
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
CREEPING = Axis(effectiveness=142.3, damping=3.38, p=0.065, i=0.082, d=0.0038, angle_p=7.35)
UNDRIVEN = Axis(effectiveness=50.0, p=0.09, i=0.0, d=0.0024)
"""A demo's tuned rate loop, whose slow integrator brings the last fifth, and one without."""
READ = (
    "level",
    "delay to half",
    "rise time",
    "overshoot",
    "gain",
    "bandwidth at -3 dB",
    "frequency at -90",
)


@cache
def truths(axis: Axis, every: int, count: int) -> tuple[dict[str, float | None], Array]:
    """What is read off the quiet loop at so many instants of an estimate, and its step there."""
    time_s = instants(axis, every, count)
    ticks = step(axis, 3.0 + time_s[-1])
    exact = np.interp(time_s, np.arange(ticks.size) / axis.loop_hz, ticks)
    pulses = np.diff(np.concatenate([[0.0], ticks]))
    loop = LoopDraws(np.array([pulses, pulses]), np.ones((2, 1)), 1.0 / axis.loop_hz)
    read = window_features(np.array([exact, exact]), time_s)
    read += frequency_features(loop, SLOWEST_HZ["rate"])
    return {r.name: r.value for r in read}, exact


def instants(axis: Axis, every: int, count: int) -> Array:
    """When a step is told, s after the tick at which the set-point jumps."""
    sample_s = every / axis.loop_hz
    return np.asarray((np.arange(count) + 0.5) * sample_s - 0.5 / axis.loop_hz)


def fly_samples(
    seed: int,
    axis: Axis,
    *,
    acro: bool,
    duration_s: float = 60.0,
    every: int = 4,
    logged: int = 1,
    lag_s: float = HAND_S,
) -> LoopSamples:
    """Samples of so many ticks of the rate loop, of a log with a row every `logged` of them."""
    flown = ordinary(axis, seed, duration_s, acro=acro, size=1.0 if acro else 0.25, lag_s=lag_s)
    rows = [each[::logged] for each in (flown.rate_wanted, flown.rate, flown.angle)]
    return LoopSamples.of([(rows[0], rows[1], rows[2])], logged / axis.loop_hz, every // logged)


def fly_loop(samples: LoopSamples, axis: Axis) -> LoopResponse:
    """What `flightid flight` makes of these samples, its window and refusals included."""
    none = np.zeros(0)
    moved, rate_hz = float(np.std(samples.set_point)), 1.0 / samples.sample_time_s
    begun = LoopResponse(
        "roll", "rate", "", "", rate_hz, samples.duration_s, 1, moved, None, none, none, none
    )
    return read_step(begun, samples, 1.0 / axis.loop_hz, "")


def fly_step(
    seed: int,
    *,
    axis: Axis,
    acro: bool,
    duration_s: float = 60.0,
    every: int = 4,
    logged: int = 1,
    lag_s: float = HAND_S,
) -> Trial:
    """Step at eight instants and every reading of one flight's rate loop."""
    samples = fly_samples(
        seed, axis, acro=acro, duration_s=duration_s, every=every, logged=logged, lag_s=lag_s
    )
    begun = time.perf_counter()
    loop = fly_loop(samples, axis)
    spent = time.perf_counter() - begun
    if not loop.is_told:
        return Trial(refusal=loop.reason, seconds=spent)
    return Trial(tuple(beside_truth(loop, axis, every)), "", spent)


def beside_truth(loop: LoopResponse, axis: Axis, every: int) -> Iterator[Reading]:
    """Numbers of a loop with the simulator's own."""
    known, exact = truths(axis, every, loop.time_s.size)
    low, high = loop.band(0.95)
    for k in np.linspace(2, loop.time_s.size - 1, INSTANTS).round().astype(int):
        ends = float(low[k]), float(high[k])
        name = f"step at {1e3 * loop.time_s[k]:.0f} ms"
        yield Reading(name, float(exact[k]), float(loop.step[k]), None, ends)
    for found in loop.readings:
        truth = known[found.name]
        if found.name.startswith(READ) and truth is not None and found.value is not None:
            yield Reading(found.name, truth, found.value, None, found.interval95)


CASES = tuple(
    Case(f"ordinary flight, {name}", partial(fly_step, axis=axis, acro=acro, **extra))
    for name, axis, acro, extra in (
        ("quadrotor, ArduPilot, angle mode", QUADROTOR, False, {}),
        ("quadrotor, ArduPilot, acro", QUADROTOR, True, {}),
        ("quadrotor, PX4, angle mode", PX4, False, {}),
        ("quadrotor, PX4, acro, 50 Hz", PX4, True, {"every": 8, "logged": 8}),
        ("quadrotor, Betaflight, acro", BETAFLIGHT, True, {"every": 4}),
        ("helicopter, angle mode", HELICOPTER, False, {}),
        ("plane, angle mode", PLANE, False, {}),
        ("quadrotor, calm", replace(QUADROTOR, gust=0.5), False, {}),
        ("helicopter, heavy gusts", replace(HELICOPTER, gust=6.0), False, {}),
        ("quadrotor, slow integrator", CREEPING, False, {}),
        ("quadrotor, no integrator", UNDRIVEN, False, {}),
    )
)
