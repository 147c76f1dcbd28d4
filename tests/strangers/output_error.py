"""Output error of a roll axis under noise of many colours; the flights are SciPy's."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.signal import lfilter

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

CASES = tuple(
    Case(f"output error, {name}", partial(fly, noise=noise)) for name, noise in COLOURS.items()
)
