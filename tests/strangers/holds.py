"""Inputs that stand still, run straight or are smooth between samples, told and not told.

The flights are SciPy's: a short period whose elevator comes late, advanced in steps of a hundredth
of a sample, on which every input is exact. Nothing of flightid is used to make them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal

import numpy as np
from scipy.signal import cont2discrete, lfilter

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial

STEP_S, FINE = 0.05, 100
DURATION_S = 60.0
TRUTH = {"Za": -1.2, "Ma": -6.0, "Mq": -1.8, "Md": -9.0, "tau": 0.073}
UNITS = {"Za": "1/s", "Ma": "1/s^2", "Mq": "1/s", "Md": "1/s^2", "tau": "s"}
NOISE = 0.02
GUST = 0.15
Array = noises.Array
Hold = Literal["zero", "first", "band_limited"]
TRUE_HOLDS: dict[str, Hold] = {
    "steps": "zero", "held": "zero", "straight": "first", "smooth": "band_limited",
    "smooth steps": "zero", "smooth lines": "first",
}  # fmt: skip
""" "smooth …": samples of sines, which tell nothing of what is between them."""
Curve = Callable[[Array], Array]


def model() -> fid.StateSpaceModel:
    """Both states measured, started a third off."""
    return fid.StateSpaceModel(
        states={"alpha": "rad", "q": "rad/s"},
        input_units={"de": "rad"},
        measurements={"alpha": fid.Output("alpha", "rad"), "q": fid.Output("q", "rad/s")},
        equations={"alpha'": "Za*alpha + q", "q'": "Ma*alpha + Mq*q + Md*de"},
        parameters=fid.Parameters(
            [
                fid.Parameter(name, 0.7 * TRUTH[name], unit, minimum=0.0 if unit == "s" else -99.0)
                for name, unit in UNITS.items()
            ]
        ),
        delays={"de": "tau"},
        name="short period",
    )


def held(random: np.random.Generator, n: int) -> Array:
    """An autopilot's output: another value at every sample."""
    return 0.05 * noises.ar1(random, n, 0.8)


def steps(random: np.random.Generator, n: int) -> Array:
    """A pilot's or a generator's steps, half a second and longer."""
    return 0.05 * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 10 + 1), 10)[:n]


def sines(random: np.random.Generator) -> Curve:
    """Sines of 0.05 to 4 Hz, by times in samples."""
    turn = 2.0 * np.pi * STEP_S * np.geomspace(0.05, 4.0, 25)
    phase = random.uniform(0.0, 2.0 * np.pi, turn.size)
    return lambda at: 0.015 * np.sin(np.multiply.outer(at, turn) + phase).sum(axis=-1)


def curve_of(random: np.random.Generator, n: int, shape: str) -> Curve:
    """The input at any time, in samples; at whole numbers it is what a log holds."""
    if shape == "smooth":
        return sines(random)
    if shape.startswith("smooth"):
        samples = sines(random)(np.arange(float(n)))
    else:
        samples = (steps if shape == "steps" else held)(random, n)
    if TRUE_HOLDS[shape] == "first":
        return lambda at: np.interp(at, np.arange(n), samples)
    # A step belongs to its sample: less than the fine step keeps rounding from moving it.
    return lambda at: samples[np.clip(np.floor(at + 1e-6).astype(int), 0, n - 1)]


def flight(seed: int, shape: str, *, told: bool | Hold, gust: bool = False) -> fid.Record:
    """One flight of a minute at 20 Hz; told the truth, nothing, or a hold that may be wrong."""
    random = np.random.default_rng(seed)
    n = round(DURATION_S / STEP_S)
    curve = curve_of(random, n, shape)
    # The middle of a fine step stands for it: exact where corners meet the fine grid.
    middle = (np.arange((n - 1) * FINE + 1) + 0.5) / FINE - TRUTH["tau"] / STEP_S
    push = TRUTH["Md"] * curve(np.maximum(middle, 0.0))
    h = STEP_S / FINE
    if gust:
        push += GUST / np.sqrt(h) * random.standard_normal(push.size)
    a = np.array([[TRUTH["Za"], 1.0], [TRUTH["Ma"], TRUTH["Mq"]]])
    matrices = (a, np.array([[0.0], [1.0]]), np.eye(2), np.zeros((2, 1)))
    phi, gamma, *_ = cont2discrete(matrices, h)
    clean = _advanced(phi, gamma[:, 0], push)[:, ::FINE]
    noise = NOISE * clean.std(axis=1)[:, None] * random.standard_normal(clean.shape)
    alpha, q = clean + noise
    hold = TRUE_HOLDS[shape] if told is True else told or None
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"de": curve(np.arange(float(n)))},
        outputs={"alpha": alpha, "q": q},
        units={"de": "rad", "alpha": "rad", "q": "rad/s"},
        name=f"flight {seed}",
        hold=hold,
        loop="open",
    )


def _advanced(phi: Array, gamma: Array, push: Array) -> Array:
    """States of x+ = phi x + gamma u from rest: each is a filter of the same poles."""
    below = np.poly(phi)
    # Cayley-Hamilton for two states: (z I - phi)^-1 = (z I + phi - tr phi I) / det(z I - phi).
    rest = (phi - np.trace(phi) * np.eye(2)) @ gamma
    return np.array([lfilter([0.0, gamma[k], rest[k]], below, push) for k in range(2)])


def fly(seed: int, *, shape: str, told: bool | Hold, method: str) -> Trial:
    """One flight, fitted as the documentation says, all options at their defaults."""
    record = flight(seed, shape, told=told, gust=method == "filter_error")

    def fit() -> fid.Fit:
        if method == "composite":
            return fid.identify(model(), fid.estimate_response(record))
        if method == "joint":
            second = flight(seed + 1_000_000, shape, told=told)
            return fid.identify(model(), (fid.estimate_response(record), second), method="joint")
        return fid.identify(model(), record, method=method)

    return fit_trial(fit, TRUTH)


METHODS = (
    "output_error", "filter_error", "equation_error", "fourier_regression",
    "fourier_output_error", "composite", "joint",
)  # fmt: skip
WRONG: dict[str, Hold] = {
    "steps": "first", "held": "first", "straight": "zero", "smooth": "zero",
    "smooth steps": "first", "smooth lines": "zero",
}  # fmt: skip
TELLINGS: tuple[tuple[str, dict[str, Hold] | bool], ...] = (
    ("told", True), ("not told", False), ("told wrong", WRONG),
)  # fmt: skip

CASES = tuple(
    Case(
        f"hold {method}, {shape}, {name}",
        partial(
            fly,
            shape=shape,
            told=told if isinstance(told, bool) else told[shape],
            method=method,
        ),
        true_hold=TRUE_HOLDS[shape] if name == "told wrong" else "",
    )
    for method in METHODS
    for shape in TRUE_HOLDS
    for name, told in TELLINGS
    if not shape.startswith("smooth ") or (method == "output_error" and name != "not told")
)
