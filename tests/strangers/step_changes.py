"""Steps of two flights by sticks alone: do intervals of the differences hold the true ones."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

from flightid.dynamics.conditions.ratios import difference_of
from flightid.errors import FlightidError
from flightid.review.deconvolution import closed_loop
from flightid.review.step_features import frequency_features, reached_features
from flightid.uncertainty.estimate import Reading as Told
from tests.strangers.counting import Case, Reading, Trial
from tests.strangers.ordinary_flights import Axis
from tests.strangers.ordinary_steps import (
    HELICOPTER,
    PX4,
    QUADROTOR,
    READ,
    SLOWEST_HZ,
    fly_samples,
    instants,
    truths,
)

EVERY, LATER = 4, 5000
"""Ticks between samples; seeds of the second flight are so much larger."""


def fly_pair(seed: int, *, before: Axis, after: Axis, acro: bool) -> Trial:
    """Differences of every reading between two flights."""
    begun = time.perf_counter()
    try:
        old = _read(seed, before, acro=acro)
        new = _read(seed + LATER, after, acro=acro)
    except FlightidError as error:
        return Trial(refusal=str(error), seconds=time.perf_counter() - begun)
    truth = [truths(axis, EVERY)[0] for axis in (before, after)]
    readings = []
    for name, first in old.items():
        ends = truth[0].get(name), truth[1].get(name)
        found = difference_of(new[name], first)
        if name.startswith(READ) and None not in ends and found.value is not None:
            exact = (ends[1] or 0.0) - (ends[0] or 0.0)
            readings.append(Reading(name, exact, found.value, None, found.interval95))
    return Trial(tuple(readings), "", time.perf_counter() - begun)


def _read(seed: int, axis: Axis, *, acro: bool) -> dict[str, Told]:
    loop = closed_loop(fly_samples(seed, axis, acro=acro, every=EVERY))
    time_s = instants(axis, EVERY)
    steps = loop.step(time_s.size)
    told = (*reached_features(steps, time_s), *frequency_features(loop, SLOWEST_HZ))
    return {each.name: each for each in told}


CASES = tuple(
    Case(f"two flights, {name}", partial(fly_pair, before=before, after=after, acro=acro))
    for name, before, after, acro in (
        ("same gains, angle mode", QUADROTOR, QUADROTOR, False),
        ("P and D a half more, angle mode", QUADROTOR, replace(QUADROTOR, p=0.18, d=0.005), False),
        ("P and D a half more, acro, PX4", PX4, replace(PX4, p=0.22, d=0.0045), True),
        ("helicopter, P doubled, angle mode", HELICOPTER, replace(HELICOPTER, p=0.2), False),
    )
)
