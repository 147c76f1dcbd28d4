"""Margins that a second opinion on an autotune gives: do their intervals hold those of the vehicle.

Twitches and steps of `tests/autotune_log.py`, whose loops share nothing with flightid's, with noise
of the gyro that the loop feeds back (rad/s at the gyro, a tick) and gusts (rad/s²).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import flightid as fid
from flightid.control.margins.margins import Margins
from flightid.errors import FlightidError
from tests.autotune_log import true_margins, write_ardupilot, write_px4
from tests.strangers.counting import Case, Reading, Trial
from tests.strangers.ordinary_flights import Axis

CALM = Axis(gust=0.0, noise=0.02, p=0.08, i=0.08, d=0.002)
HEAVY = replace(CALM, effectiveness=60.0, motor_s=0.08, p=0.15, i=0.15, d=0.004)
TRIM, JITTER_S, FILTERS_HZ = 0.02, 4e-5, (20.0, 80.0)
PX4 = Axis(form="px4", gust=0.0, noise=0.02, p=0.1, i=0.15, d=0.002, derivative_hz=30.0)


def by_twitches(path: Path, seed: int, axis: Axis) -> Axis:
    """ArduCopter's; the axis with the gains that came out."""
    gains = write_ardupilot(path, axis, seed=seed)
    return replace(axis, p=gains.p, i=gains.p, d=gains.d)


def as_flown(path: Path, seed: int, axis: Axis) -> Axis:
    """With a trim, level until each twitch, from the rate that it has, by stamps that scatter."""
    trim = float(TRIM * np.random.default_rng([seed, 2]).standard_normal())
    gains = write_ardupilot(path, axis, seed=seed, trim=trim, jitter_s=JITTER_S, held=True)
    return replace(axis, p=gains.p, i=gains.p, d=gains.d)


def by_steps(path: Path, seed: int, axis: Axis, *, log_hz: float = 100.0) -> Axis:
    """PX4's."""
    write_px4(path, axis, (0.15, 1.5, 0.02), seed=seed, log_hz=log_hz)
    return replace(axis, p=0.15, i=0.225, d=0.003)


def fly(seed: int, *, axis: Axis, tuned: Callable[[Path, int, Axis], Axis], suffix: str) -> Trial:
    """Crossover and margins of roll with the gains before and after."""
    begun = time.perf_counter()
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"autotune{suffix}"
        after = tuned(path, seed, axis)
        try:
            (roll,) = fid.review_autotune(path).opinions
        except FlightidError as error:
            return Trial(refusal=str(error), seconds=time.perf_counter() - begun)
    seconds = time.perf_counter() - begun
    if roll.flown is None or roll.tuned is None or roll.fit is None:
        return Trial(refusal=roll.reason, seconds=seconds)
    readings = (*_read("flown", roll.flown, axis), *_read("tuned", roll.tuned, after))
    return Trial(readings, roll.fit.evidence.light.value, seconds)


def _read(which: str, found: Margins, axis: Axis) -> list[Reading]:
    told = (found.crossover, found.phase_margin, found.gain_margin)
    names = ("crossover", "phase margin", "gain margin")
    units = (2.0 * np.pi, 1.0, 1.0)
    return [
        Reading(f"{which} {name}", unit * exact, each.value, None, each.interval95)
        for name, each, exact, unit in zip(names, told, true_margins(axis), units, strict=True)
        if each.value is not None
    ]


AIR = ((0.02, 0.0), (0.05, 0.0), (0.1, 0.0), (0.2, 0.0), (0.02, 0.3), (0.1, 0.3), (0.2, 0.3))
"""Gyro noise and gusts. Gains by twitches are small where noise is: D goes to its least."""


def _cases(
    name: str, axis: Axis, tuned: Callable[[Path, int, Axis], Axis], suffix: str
) -> list[Case]:
    return [
        Case(
            f"autotune, {name}, noise {noise:g}" + (f", gusts {gust:g}" if gust else ""),
            partial(fly, axis=replace(axis, noise=noise, gust=gust), tuned=tuned, suffix=suffix),
        )
        for noise, gust in AIR
    ]


LIGHTS = (
    *_cases("ArduCopter's twitches", CALM, by_twitches, ".bin"),
    *_cases("heavy vehicle", HEAVY, by_twitches, ".bin"),
    *(
        case
        for hz in FILTERS_HZ
        for case in _cases(
            f"twitches as flown, gyro filter {hz:g} Hz", replace(CALM, gyro_hz=hz), as_flown, ".bin"
        )
    ),
    *_cases("PX4's steps at the loop's rate", PX4, partial(by_steps, log_hz=400.0), ".ulg"),
    Case(
        "autotune, PX4's steps at a quarter of it",
        partial(fly, axis=PX4, tuned=by_steps, suffix=".ulg"),
    ),
)
