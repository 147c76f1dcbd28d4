"""What a direct estimate says of its loop's bias, beside the shifts that its parameters have.

An autopilot of ArduPilot's kind holds one axis against gusts while a sweep is injected, logged at
its rate or a part of it; and a pilot steadies heave. Both answer within the sample.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import cache, partial
from unittest import mock

import numpy as np

import flightid as fid
from flightid.identification.frequency_domain import fit as fitting
from tests.strangers import closed_loops, hover, noises

TRUTH = {"Ltphi": 140.0, "Lp": -3.4, "T_m": 0.045, "tau": 0.014}
"""Of the axis; its delays stand for the hold and the gyro's filter too, so they are a start."""
Flight = tuple[fid.Fit, Mapping[str, float], dict[str, float]]
"""A fit, true values, and the bias that it claims."""


def _fit(model: fid.Model, response: fid.FrequencyResponse, truth: Mapping[str, float]) -> Flight:
    with mock.patch.object(fitting, "judge_feedback", wraps=fitting.judge_feedback) as judge:
        fit = fid.identify(model, response)
    names, _, bias = judge.call_args.args
    return fit, truth, {} if bias is None else dict(zip(names, map(float, bias), strict=True))


def _swept(seed: int, every: int, gust: float, gyro: float) -> tuple[fid.Model, fid.Record]:
    craft = hover.vehicle("x", effect=140.0, damping=-3.4, motor_s=0.045, delay=4, gyro_hz=80.0)
    axis, random = (
        hover.Axis(craft, hover.Gains(0.06, 0.06, 0.002, 4.5)),
        np.random.default_rng(seed),
    )
    t = np.arange(24000) * hover.STEP_S
    rate = np.log(60.0) / t[-1]
    sweep = 0.1 * np.sin(0.5 * (np.exp(rate * t) - 1.0) / rate)
    blown = gust * noises.ar1(random, t.size, 0.99)
    u, p = axis.fly(sweep, gyro * random.standard_normal(t.size), blown)
    record = fid.Record.from_arrays(
        t[::every],
        inputs={"tau_phi": u[::every]},
        outputs={"p": p[::every]},
        units={"tau_phi": "1", "p": "rad/s"},
        hold="zero" if every == 1 else None,
        loop="closed",
    )
    return fid.load_model("rate_motor_lag", axis="roll").with_values(TRUTH), record


@cache
def _quiet(every: int) -> dict[str, float]:
    """Estimates without noise: what the template makes of this vehicle."""
    fit = _axis(0, every, 0.0, 0.0, TRUTH)[0]
    return {name: fit.parameters[name].value for name in TRUTH}


def _axis(seed: int, every: int, gust: float, gyro: float, truth: Mapping[str, float]) -> Flight:
    model, record = _swept(seed, every, gust, gyro)
    response = fid.estimate_response(record, estimator="composite", band_rad_s=(1.5, 23.0))
    return _fit(model, response, truth)


def axis(seed: int, *, every: int, gust: float = 0.002, gyro: float = 0.003) -> Flight:
    """One axis held by its autopilot, logged at every so many loops."""
    return _axis(seed, every, gust, gyro, _quiet(every))


def heave(seed: int) -> Flight:
    """Heave held by a pilot while he sweeps."""
    flown = closed_loops.record(seed, feedback=closed_loops.PILOT)
    response = fid.estimate_response(flown, estimator="composite", band_rad_s=(0.5, 10.0))
    return _fit(closed_loops.model(), response, closed_loops.TRUTH)


FAMILIES: Mapping[str, Callable[[int], Flight]] = {
    "axis, held": partial(axis, every=1),
    "axis, logged at a quarter": partial(axis, every=4),
    "axis, logged at an eighth": partial(axis, every=8),
    "axis in gusts": partial(axis, every=4, gust=0.006),
    "heave by hand": heave,
}


def claimed_and_true(
    family: Callable[[int], Flight], seeds: Iterable[int]
) -> tuple[dict[str, float], dict[str, float]]:
    """Median claim of each parameter, and its mean shift where that stands out of the scatter."""
    flights = []
    for seed in seeds:
        with suppress(fid.FlightidError):  # a typed refusal claims nothing
            flights.append(family(seed))
    flights = [each for each in flights if each[2]]  # a loop that was not seen claims nothing
    claimed, shifts = {}, {}
    for name in flights[0][2]:
        moved = np.array([fit.parameters[name].value - truth[name] for fit, truth, _ in flights])
        mean = float(np.mean(moved))
        if abs(mean) > 3.0 * float(np.std(moved)) / np.sqrt(len(moved)):
            shifts[name] = mean
            claimed[name] = float(np.median([claim[name] for _, _, claim in flights]))
    return claimed, shifts
