"""Steps of two flights by sticks alone: do intervals of the differences hold the true ones."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

from flightid.dynamics.conditions.ratios import difference_of
from flightid.review.comparison import pairs
from tests.strangers.counting import Case, Reading, Trial
from tests.strangers.ordinary_flights import Axis
from tests.strangers.ordinary_steps import (
    HELICOPTER,
    PX4,
    QUADROTOR,
    READ,
    fly_loop,
    fly_samples,
    truths,
)

EVERY, LATER = 4, 5000
"""Ticks between samples; seeds of the second flight are so much larger."""


def fly_pair(seed: int, *, before: Axis, after: Axis, acro: bool) -> Trial:
    """Differences of every reading between two flights."""
    begun = time.perf_counter()
    old, new = (
        fly_loop(fly_samples(at, axis, acro=acro, every=EVERY), axis)
        for at, axis in ((seed, before), (seed + LATER, after))
    )
    spent = time.perf_counter() - begun
    if not (old.is_told and new.is_told):
        return Trial(refusal=old.reason or new.reason, seconds=spent)
    count = min(old.time_s.size, new.time_s.size)
    truth = [truths(axis, EVERY, count)[0] for axis in (before, after)]
    readings = []
    for first, second in pairs(old, new):
        ends = truth[0].get(first.name), truth[1].get(first.name)
        found = difference_of(second, first)
        if first.name.startswith(READ) and None not in ends and found.value is not None:
            exact = (ends[1] or 0.0) - (ends[0] or 0.0)
            readings.append(Reading(first.name, exact, found.value, None, found.interval95))
    return Trial(tuple(readings), "", spent)


CASES = tuple(
    Case(f"two flights, {name}", partial(fly_pair, before=before, after=after, acro=acro))
    for name, before, after, acro in (
        ("same gains, angle mode", QUADROTOR, QUADROTOR, False),
        ("P and D a half more, angle mode", QUADROTOR, replace(QUADROTOR, p=0.18, d=0.005), False),
        ("P and D a half more, acro, PX4", PX4, replace(PX4, p=0.22, d=0.0045), True),
        ("helicopter, P doubled, angle mode", HELICOPTER, replace(HELICOPTER, p=0.2), False),
    )
)
