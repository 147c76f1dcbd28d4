"""Flights that hold nothing to be identified, which may never be green, and good ones beside them.

A roll axis in NumPy's own recursion: gusts, a controller, sensors and their faults. `BARREN` counts
false greens (goal: none), `SOUND` false reds (goal: 3 in 100). Every flight goes by way of a file.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial
from tests.strangers.output_error import STEP_S, TRUTH, model

DURATION_S = 30.0
GAIN = 0.15
"""Of the rate controller, rad of aileron a rad/s."""
Array = noises.Array
Columns = dict[str, Array]
"""Aileron, rate and bank angle: da, p, phi."""


def flown(
    random: np.random.Generator, injected: Array, *, gust: float, gain: float, sensor: float
) -> Columns:
    """One flight: aileron as injected and fed back, gusts on the rate, noise of the gyroscope."""
    n = injected.size
    decay = np.exp(TRUTH["Lp"] * STEP_S)
    control = TRUTH["Lda"] * (decay - 1.0) / TRUTH["Lp"]
    shaken = gust * noises.ar1(random, n, 0.8)
    hiss = sensor * random.standard_normal(n)
    p, measured, aileron = np.zeros(n + 1), np.zeros(n), np.zeros(n)
    for k in range(n):
        measured[k] = p[k] + hiss[k]
        aileron[k] = injected[k] - gain * measured[k]
        p[k + 1] = decay * p[k] + control * aileron[k] + shaken[k]
    bank = np.concatenate([[0.0], np.cumsum(0.5 * (p[1:n] + p[: n - 1])) * STEP_S])
    return {"da": aileron, "p": measured, "phi": bank}


def steps(random: np.random.Generator, n: int) -> Array:
    """Steps of 0.6 s, 3 deg."""
    return 0.05 * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 30 + 1), 30)[:n]


def sweep(random: np.random.Generator, n: int) -> Array:
    """A sweep of 0.2 to 4 Hz at one of several amplitudes."""
    time_s = np.arange(n) * STEP_S
    rise = 4.0 / (2.0 * time_s[-1])
    return random.uniform(0.03, 0.08) * np.sin(2 * np.pi * (0.2 + rise * time_s) * time_s)


def _n(duration_s: float = DURATION_S) -> int:
    return round(duration_s / STEP_S)


def hover(random: np.random.Generator, *, gain: float = GAIN) -> Columns:
    """No injection at all: the controller answers gusts."""
    return flown(random, np.zeros(_n()), gust=0.01, gain=gain, sensor=0.005)


def hands_off(random: np.random.Generator) -> Columns:
    """Loop open, the stick within its noise, gusts alone."""
    still = 2e-4 * noises.ar1(random, _n(), 0.9)
    return flown(random, still, gust=0.01, gain=0.0, sensor=0.005)


def open_loop(random: np.random.Generator, *, injected: Callable[..., Array] = steps) -> Columns:
    """A good manoeuvre with the loop open in calm air."""
    return flown(random, injected(random, _n()), gust=0.0, gain=0.0, sensor=0.01)


def wrong_units(random: np.random.Generator) -> Columns:
    """A good manoeuvre, its gyroscope in deg/s under a heading of rad/s."""
    good = open_loop(random)
    return {**good, "p": np.degrees(good["p"])}


def spiked(random: np.random.Generator) -> Columns:
    """A good manoeuvre with three samples far off."""
    good = open_loop(random)
    hit = good["p"].copy()
    hit[random.choice(hit.size, 3, replace=False)] += 40.0 * np.std(hit) * random.choice([-1, 1], 3)
    return {**good, "p": hit}


def dropped(random: np.random.Generator) -> Columns:
    """A good manoeuvre whose gyroscope stands still for a fifth of it."""
    good = open_loop(random)
    start = int(random.integers(200, 900))
    held = good["p"].copy()
    held[start : start + _n() // 5] = held[start]
    return {**good, "p": held}


def cut(random: np.random.Generator) -> Columns:
    """A good manoeuvre of which a second is left."""
    start = int(random.integers(0, _n() - 60))
    return {name: samples[start : start + 55] for name, samples in open_loop(random).items()}


def one_record(columns: Columns) -> fid.Record:
    """The flight as it comes back from a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.csv"
        time_s = np.arange(columns["p"].size) * STEP_S
        table = np.column_stack([time_s, *columns.values()])
        heading = "time [s],da [rad],p [rad/s],phi [rad]"
        np.savetxt(path, table, "%.9g", ",", header=heading, comments="")
        (record,) = fid.read_records(path, "da", "p", others="phi", hold="zero")
    return record


def fitted(seed: int, *, flight: Callable[[np.random.Generator], Columns], method: str) -> Trial:
    """One flight, fitted as the documentation says."""
    record = one_record(flight(np.random.default_rng([seed, 12])))
    if method == "arx":
        equation = fid.PolynomialModel.arx("da", "p", na=1, nb=1, nk=1)
        return fit_trial(lambda: fid.identify(equation, record), {})
    if method == "oe":
        simulated = fid.PolynomialModel.oe("da", "p", nb=1, nf=1, nk=1)
        return fit_trial(lambda: fid.identify(simulated, record), {})
    return fit_trial(lambda: fid.identify(model(), record, method=method), TRUTH)


def in_a_loop(seed: int, *, gust: float, gain: float) -> Trial:
    """A sweep under a rate controller that stays on, fitted by way of what was injected."""
    random = np.random.default_rng([seed, 14])
    injected = sweep(random, _n())
    columns = flown(random, injected, gust=gust, gain=gain, sensor=0.005)
    record = fid.Record.from_arrays(
        np.arange(injected.size) * STEP_S,
        inputs={"da": columns["da"]},
        outputs={"p": columns["p"]},
        excitations={"da_injected": injected},
        units={"da": "rad", "p": "rad/s", "da_injected": "rad"},
        hold="zero",
        loop="closed",
    )
    response = fid.estimate_response(record, estimator="instrument")
    return fit_trial(lambda: fid.identify(model(), response), TRUTH)


BARREN_FLIGHTS = {
    "hover": hover,
    "hover, tight": partial(hover, gain=0.5),
    "hands off": hands_off,
    "wrong units": wrong_units,
    "spikes": spiked,
    "dead sensor": dropped,
    "cut": cut,
}
SOUND_FLIGHTS = {"steps": open_loop, "sweep": partial(open_loop, injected=sweep)}


def _cases(
    flights: dict[str, Callable[..., Columns]], group: str, methods: tuple[str, ...]
) -> tuple[Case, ...]:
    return tuple(
        Case(f"{group}, {method}, {name}", partial(fitted, flight=flight, method=method))
        for name, flight in flights.items()
        for method in methods
    )


BARREN = _cases(BARREN_FLIGHTS, "barren", ("output_error", "arx", "oe"))
SOUND = _cases(SOUND_FLIGHTS, "sound", ("output_error", "oe"))
"""ARX shares its noise's poles, which a gyroscope's noise does not: red is true there."""
LOOPED = tuple(
    Case(f"sound, instrument, {name}", partial(in_a_loop, gust=gust, gain=gain))
    for name, gust, gain in (("calm", 0.0, GAIN), ("gusts", 0.003, 0.5), ("heavy gusts", 0.01, 0.5))
)
LIGHTS = (*BARREN, *SOUND, *LOOPED)
