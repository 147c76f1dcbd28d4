"""A delayed roll axis with process noise: delays on and off the sample grid; steps of SciPy's."""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.signal import lfilter

import flightid as fid
from tests.strangers.counting import Case, Trial, fit_trial

STEP_S = 0.01
FINE = 20
TRUTH = {"Lp": -3.0, "Lda": 12.0}


def model(delay_s: float) -> fid.StateSpaceModel:
    """One state behind a delay, all three numbers started off."""
    return fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"da": "rad"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p + Lda*da"},
        parameters=fid.Parameters(
            [
                fid.Parameter("Lp", -2.5, "1/s"),
                fid.Parameter("Lda", 10.0, "1/s^2"),
                fid.Parameter("tau", 0.9 * delay_s, "s", minimum=0.0, maximum=0.3),
            ]
        ),
        delays={"da": "tau"},
        name="delayed roll",
    )


def flight(seed: int, delay_s: float, disturbance: float, duration_s: float = 30.0) -> fid.Record:
    """Steps held for a sample, delayed by a whole number of fine steps."""
    random = np.random.default_rng(seed)
    n, dt = round(duration_s / STEP_S), STEP_S / FINE
    steps = 0.05 * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 40 + 1), 40)[:n]
    fine = np.repeat(steps, FINE)
    late = round(delay_s / dt)
    fine = np.concatenate([np.full(late, fine[0]), fine])[: n * FINE]
    decay = np.exp(TRUTH["Lp"] * dt)
    gain = TRUTH["Lda"] * (decay - 1.0) / TRUTH["Lp"]
    pushed = gain * fine + disturbance * np.sqrt(dt) * random.standard_normal(fine.size)
    rate = lfilter([0.0, 1.0], [1.0, -decay], pushed)[::FINE]
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"da": steps},
        outputs={"p": rate + 0.01 * random.standard_normal(n)},
        units={"da": "rad", "p": "rad/s"},
        hold="zero",
    )


def fly(seed: int, *, delay_s: float, method: str) -> Trial:
    """One flight, all options at their defaults."""
    record = flight(seed, delay_s, 0.05 if method == "filter_error" else 0.0)
    truth = {**TRUTH, "tau": delay_s}
    return fit_trial(lambda: fid.identify(model(delay_s), record, method=method), truth)


CASES = tuple(
    Case(f"delay {delay_s:g} s, {method}", partial(fly, delay_s=delay_s, method=method))
    for method in ("filter_error", "output_error", "fourier_output_error")
    for delay_s in (0.11, 0.1135)
)
