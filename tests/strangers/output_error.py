"""Output error of a roll axis under noise of many colours; the flights are SciPy's."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.signal import cont2discrete, lfilter

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial

STEP_S = 0.02
TRUTH = {"Lp": -3.0, "Lda": 12.0}
Noise = Callable[[np.random.Generator, int], noises.Array]


def model() -> fid.StateSpaceModel:
    """One state, both coefficients free, started half off."""
    return fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"da": "rad"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p + Lda*da"},
        parameters=fid.Parameters(
            [fid.Parameter("Lp", -1.5, "1/s"), fid.Parameter("Lda", 6.0, "1/s^2")]
        ),
        name="roll",
    )


def flight(seed: int, noise: Noise, duration_s: float = 30.0) -> fid.Record:
    """Steps of random length held between samples, exact by their discretisation."""
    random = np.random.default_rng(seed)
    n = round(duration_s / STEP_S)
    steps = 0.05 * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 30 + 1), 30)[:n]
    decay = np.exp(TRUTH["Lp"] * STEP_S)
    gain = TRUTH["Lda"] * (decay - 1.0) / TRUTH["Lp"]
    rate = lfilter([0.0, gain], [1.0, -decay], steps)
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"da": steps},
        outputs={"p": rate + 0.1 * rate.std() * noise(random, n)},
        units={"da": "rad", "p": "rad/s"},
        hold="zero",
    )


def late(seed: int, lag_s: float, level: float, noise: Noise) -> fid.Record:
    """The same behind an actuator's lag, which the model lacks."""
    random = np.random.default_rng([seed, 5])
    n = round(30.0 / STEP_S)
    steps = 0.05 * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 30 + 1), 30)[:n]
    a = np.array([[TRUTH["Lp"], TRUTH["Lda"]], [0.0, -1.0 / lag_s]])
    b, c = np.array([[0.0], [1.0 / lag_s]]), np.array([[1.0, 0.0]])
    phi, gamma, *_ = cont2discrete((a, b, c, np.zeros((1, 1))), STEP_S)
    below = np.poly(phi)
    above = np.poly(phi - gamma @ c) - below
    rate = lfilter(above, below, steps)
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"da": steps},
        outputs={"p": rate + level * rate.std() * noise(random, n)},
        units={"da": "rad", "p": "rad/s"},
        hold="zero",
    )


def fly_late(seed: int, *, lag_s: float, level: float, noise: Noise) -> Trial:
    """One flight with a lag that the model lacks."""
    return fit_trial(
        lambda: fid.identify(model(), late(seed, lag_s, level, noise), method="output_error"), TRUTH
    )


def fly(seed: int, *, noise: Noise) -> Trial:
    """One flight, fitted as the documentation says, all options at their defaults."""
    return fit_trial(
        lambda: fid.identify(model(), flight(seed, noise), method="output_error"), TRUTH
    )


COLOURS: dict[str, Noise] = {
    "white": noises.white,
    "AR(1) -0.5": partial(noises.ar1, pole=-0.5),
    "AR(1) 0.9": partial(noises.ar1, pole=0.9),
    "AR(1) 0.98": partial(noises.ar1, pole=0.98),
    "AR(2) resonant": partial(noises.ar2, radius=0.97, angle=0.15),
    "drift": noises.drift,
}

LATE = tuple(
    Case(
        f"output error, {1e3 * lag_s:.0f} ms of lag missing, {100 * level:.0f} % of {name}",
        partial(fly_late, lag_s=lag_s, level=level, noise=COLOURS[name]),
    )
    for lag_s in (0.01, 0.04)
    for level in (0.02, 0.1)
    for name in ("white", "AR(1) 0.9")
)
CASES = (
    *(Case(f"output error, {name}", partial(fly, noise=noise)) for name, noise in COLOURS.items()),
    *LATE,
)
