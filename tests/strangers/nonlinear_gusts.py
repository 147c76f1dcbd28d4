"""Pitch with quadratic terms under noise on its states; NumPy's own steps."""

from __future__ import annotations

from functools import partial

import numpy as np

import flightid as fid
from tests.strangers.counting import Case, Trial, fit_trial

STEP_S, FINE = 0.02, 10
TRUTH = {"Za": -1.2, "Ma": -6.0, "Maa": -60.0, "Mq": -1.8, "Mqa": -15.0, "Md": -9.0}
UNITS = {
    "Za": "1/s", "Ma": "1/s^2", "Maa": "1/s^2", "Mq": "1/s", "Mqa": "1/s", "Md": "1/s^2",
}  # fmt: skip


def model() -> fid.StateSpaceModel:
    """Both states measured; moments with a square and a product; started a third off."""
    return fid.StateSpaceModel(
        states={"alpha": "rad", "q": "rad/s"},
        input_units={"de": "rad"},
        measurements={"alpha": fid.Output("alpha", "rad"), "q": fid.Output("q", "rad/s")},
        equations={
            "alpha'": "Za*alpha + q",
            "q'": "Ma*alpha + Maa*alpha*abs(alpha) + Mq*q + Mqa*q*abs(alpha) + Md*de",
        },
        parameters=fid.Parameters(
            [fid.Parameter(name, 0.7 * TRUTH[name], unit) for name, unit in UNITS.items()]
        ),
        name="pitch with squares",
    )


def flight(seed: int, process: tuple[float, float], duration_s: float = 40.0) -> fid.Record:
    """Steps held between samples; densities' roots of the noise on both state derivatives."""
    random = np.random.default_rng(seed)
    n = round(duration_s / STEP_S)
    steps = 0.25 * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 35 + 1), 35)[:n]
    kicks = random.standard_normal((n, FINE, 2)) * np.array(process) * np.sqrt(STEP_S / FINE)
    t, h, (alpha, q) = TRUTH, STEP_S / FINE, (0.0, 0.0)
    path = np.empty((2, n))

    def slope(alpha: float, q: float, de: float) -> tuple[float, float]:
        moment = t["Ma"] * alpha + t["Maa"] * alpha * abs(alpha) + t["Md"] * de
        return t["Za"] * alpha + q, moment + (t["Mq"] + t["Mqa"] * abs(alpha)) * q

    for k in range(n):
        path[:, k] = alpha, q
        for kick in kicks[k]:
            a1, q1 = slope(alpha, q, steps[k])
            a2, q2 = slope(alpha + h * a1, q + h * q1, steps[k])
            alpha += 0.5 * h * (a1 + a2) + kick[0]
            q += 0.5 * h * (q1 + q2) + kick[1]
    seen = path + np.array([[0.004], [0.01]]) * random.standard_normal((2, n))
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"de": steps},
        outputs={"alpha": seen[0], "q": seen[1]},
        units={"de": "rad", "alpha": "rad", "q": "rad/s"},
        hold="zero",
        loop="open",
    )


def fly(seed: int, *, process: tuple[float, float], method: str) -> Trial:
    """All options at their defaults."""
    record = flight(seed, process)
    return fit_trial(lambda: fid.identify(model(), record, method=method), TRUTH)


CASES = tuple(
    Case(f"{method}, squares, {name}", partial(fly, process=process, method=method))
    for method in ("filter_error", "output_error")
    for name, process in (("calm", (0.0, 0.0)), ("gusts", (0.02, 0.2)))
)
