"""Fits to frequency responses: light damping in short records, and delays that feed through."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from scipy.signal import cont2discrete, lfilter

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial

STEP_S = 0.02
NATURAL = 4.09
"""Square of the natural frequency, 1/s²."""
ROUGHNESS = 0.05
"""Noise over the output's deviation."""
Array = noises.Array


def sweep(n: int, low: float = 0.5, high: float = 12.0) -> Array:
    """Logarithmic sweep between two frequencies (rad/s), its ends faded."""
    t = np.arange(n) * STEP_S
    rate = np.log(high / low) / t[-1]
    fade = np.minimum(1.0, np.minimum(t, t[-1] - t) / 1.0)
    return 0.1 * fade * np.sin(low * (np.exp(rate * t) - 1.0) / rate)


def multisine(n: int, period_s: float = 10.0, high: float = 12.0) -> Array:
    """Harmonics of one period with equal amplitudes and Schroeder's phases, repeated."""
    t = np.arange(n) * STEP_S
    last = int(high * period_s / (2.0 * np.pi))
    k = np.arange(1, last + 1)[:, None]
    phases = -np.pi * k * (k - 1) / last
    return 0.1 / np.sqrt(last) * np.cos(2.0 * np.pi * k * t / period_s + phases).sum(axis=0)


def held(a: list[list[float]], b: list[float], c: list[list[float]], u: Array) -> Array:
    """States driven by steps between samples, exact, from rest."""
    system = np.array(a), np.array(b)[:, None], np.array(c), np.zeros((len(c), 1))
    ad, bd, cd, *_ = cont2discrete(system, STEP_S)
    state, out = np.zeros(len(a)), np.zeros((len(c), len(u)))
    for k, value in enumerate(u):
        out[:, k] = cd @ state
        state = ad @ state + bd[:, 0] * value
    return out


def late(u: Array, delay_s: float) -> Array:
    """A staircase after a delay, as seen just after each sample."""
    whole = int(np.ceil(delay_s / STEP_S - 1e-9))
    return np.concatenate([np.full(whole, u[0]), u])[: len(u)]


def oscillator(zeta: float) -> fid.TransferFunctionModel:
    """K/(s² + d s + w2), started some way off."""
    parameters = [
        fid.Parameter("K", 6.0, "1/s^2"),
        fid.Parameter("d", 4.0 * zeta * np.sqrt(NATURAL), "1/s", minimum=1e-4, maximum=20.0),
        fid.Parameter("w2", 0.85 * NATURAL, "1/s^2", minimum=0.1, maximum=100.0),
    ]
    path = fid.TransferFunction("y", "u", "K", denominator=("s^2 + d*s + w2",))
    return fid.TransferFunctionModel((path,), fid.Parameters(parameters))


def fly_oscillator(
    seed: int, *, zeta: float, duration_s: float, shape: Callable[[int], Array], **known: float
) -> Trial:
    """One record of a second-order vehicle from rest, all options at their defaults."""
    random = np.random.default_rng(seed)
    n = round(duration_s / STEP_S)
    damping, gain = 2.0 * zeta * np.sqrt(NATURAL), 8.0
    u = shape(n)
    y = held([[0.0, 1.0], [-NATURAL, -damping]], [0.0, gain], [[1.0, 0.0]], u)[0]
    record = fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"u": u},
        outputs={"y": y + ROUGHNESS * y.std() * noises.white(random, n)},
        units={"u": "1", "y": "1"},
        hold="zero",
        **known,
    )
    truth = {"K": gain, "d": damping, "w2": NATURAL}
    return fit_trial(lambda: fid.identify(oscillator(zeta), fid.estimate_response(record)), truth)


LAG = {"Lp": -3.0, "Lda": 12.0, "Yda": 4.0, "Yp": 0.8}


def feedthrough() -> fid.StateSpaceModel:
    """Roll rate, and a sideways acceleration that the aileron reaches without a state between."""
    values = {"Lp": -4.0, "Lda": 10.0, "Yda": 3.0, "Yp": 0.5}
    units = {"Lp": "1/s", "Lda": "1/s^2", "Yda": "m/s^2", "Yp": "m/s"}
    parameters = [fid.Parameter(name, value, units[name]) for name, value in values.items()]
    parameters.append(fid.Parameter("tau", 0.07, "s", minimum=0.0, maximum=0.4))
    return fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"da": "rad"},
        measurements={
            "p": fid.Output("p", "rad/s"),
            "ay": fid.Output("Yp*p + Yda*da", "m/s^2"),
        },
        equations={"p'": "Lp*p + Lda*da"},
        parameters=fid.Parameters(parameters),
        delays={"da": "tau"},
        name="roll and side force",
    )


def fly_feedthrough(seed: int, *, delay_s: float, colour: float = 0.0) -> Trial:
    """A delayed staircase drives a rate and feeds straight through to an acceleration."""
    random = np.random.default_rng(seed)
    n = round(40.0 / STEP_S)
    u = sweep(n, 0.5, 15.0)
    whole = int(np.ceil(delay_s / STEP_S - 1e-9))
    part = whole * STEP_S - delay_s  # of a step in which the newer value already acts
    lp, lda = LAG["Lp"], LAG["Lda"]
    decay = np.exp(lp * STEP_S)
    first = lda * (np.exp(lp * part) - 1.0) / lp
    both = lda * (decay - 1.0) / lp
    before, newer = late(u, whole * STEP_S), late(u, max(whole - 1, 0) * STEP_S)
    rate = lfilter([0.0, 1.0], [1.0, -decay], first * newer + (both - first) * before)
    side = LAG["Yp"] * rate + LAG["Yda"] * before
    noise = [noises.ar1(random, n, colour) for _ in range(2)]
    record = fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"da": u},
        outputs={
            "p": rate + ROUGHNESS * rate.std() * noise[0],
            "ay": side + ROUGHNESS * side.std() * noise[1],
        },
        units={"da": "rad", "p": "rad/s", "ay": "m/s^2"},
        hold="zero",
    )
    truth: Mapping[str, float] = {**LAG, "tau": delay_s}
    return fit_trial(lambda: fid.identify(feedthrough(), fid.estimate_response(record)), truth)


CASES = (
    *(
        Case(
            f"response, zeta {zeta:g}, {duration_s:.0f} s, sweep",
            partial(fly_oscillator, zeta=zeta, duration_s=duration_s, shape=sweep),
        )
        for zeta in (0.02, 0.05, 0.3)
        for duration_s in (20.0, 60.0)
    ),
    *(
        Case(
            f"response, zeta {zeta:g}, {duration_s:.0f} s, multisine",
            partial(
                fly_oscillator, zeta=zeta, duration_s=duration_s, shape=multisine, period_s=10.0
            ),
        )
        for zeta in (0.02, 0.3)
        for duration_s in (20.0, 60.0)
    ),
    Case("response, feedthrough, delay 0.1", partial(fly_feedthrough, delay_s=0.1)),
    Case("response, feedthrough, delay 0.1137", partial(fly_feedthrough, delay_s=0.1137)),
    Case(
        "response, feedthrough, delay 0.1, AR(1) 0.9",
        partial(fly_feedthrough, delay_s=0.1, colour=0.9),
    ),
)
