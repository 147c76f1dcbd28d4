"""A short period in Dryden's vertical gust: five steps of its own a sample, then noise."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from scipy.linalg import expm
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial

STEP_S = 0.02
FINE = 5
"""Integration steps in one sample."""
SPEED = 40.0
TRUTH = {"Zw": -1.2, "Mw": -0.12, "Mq": -2.0, "Zd": -6.0, "Md": -14.0}


def model(factor: float = 0.8) -> fid.StateSpaceModel:
    """Heave and pitch rate, five coefficients, started off by a factor."""
    names = {"Zw": "1/s", "Mw": "rad/s/m", "Mq": "1/s", "Zd": "m/s^2", "Md": "1/s^2"}
    return fid.StateSpaceModel(
        states={"w": "m/s", "q": "rad/s"},
        input_units={"de": "rad"},
        measurements={"q": fid.Output("q", "rad/s"), "az": fid.Output("Zw*w + Zd*de", "m/s^2")},
        equations={"w'": "Zw*w + U0*q + Zd*de", "q'": "Mw*w + Mq*q + Md*de"},
        parameters=fid.Parameters(
            [
                *(fid.Parameter(name, factor * TRUTH[name], unit) for name, unit in names.items()),
                fid.Parameter("U0", SPEED, "m/s", free=False),
            ]
        ),
        name="short period",
    )


def flight(
    seed: int,
    gust_m_s: float,
    time_s: float,
    duration_s: float = 60.0,
    t: Mapping[str, float] = TRUTH,
) -> fid.Record:
    """Rounded random steps in a gust of that deviation and L / V, sampled with white noise."""
    random = np.random.default_rng(seed)
    n = round(duration_s / STEP_S)
    dt, many = STEP_S / FINE, n * FINE
    hold = round(0.7 / dt)
    steps = np.repeat(random.choice([-1.0, 0.0, 1.0], many // hold + 1), hold)[:many]
    elevator = 0.04 * gaussian_filter1d(steps, 0.06 / dt)
    gust = noises.dryden_vertical(random, many, dt, gust_m_s, time_s)
    a = np.array([[t["Zw"], SPEED], [t["Mw"], t["Mq"]]])
    b = np.array([[t["Zw"], t["Zd"]], [t["Mw"], t["Md"]]])
    phi = expm(np.block([[a, b], [np.zeros((2, 4))]]) * dt)
    driven = np.array([gust, elevator])
    # Held at the mean of both ends of a step: no half step of delay.
    forcing = phi[:2, 2:] @ (0.5 * (driven + np.roll(driven, -1, axis=1)))
    states = _recursion(phi[:2, :2], forcing)[:, ::FINE]
    gust, elevator = gust[::FINE], elevator[::FINE]
    az = t["Zw"] * (states[0] + gust) + t["Zd"] * elevator
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"de": elevator},
        outputs={
            "q": states[1] + 0.002 * random.standard_normal(n),
            "az": az + 0.05 * random.standard_normal(n),
        },
        units={"de": "rad", "q": "rad/s", "az": "m/s^2"},
        hold="first",
    )


def _recursion(phi: np.ndarray, forcing: np.ndarray) -> np.ndarray:
    """x⁺ = Φ x + f, by the eigenvectors of Φ."""
    values, vectors = np.linalg.eig(phi)
    modal = np.linalg.solve(vectors, forcing.astype(complex))
    late = [lfilter([0.0, 1.0], [1.0, -v], row) for v, row in zip(values, modal, strict=True)]
    return np.real(vectors @ np.array(late))


def fly(seed: int, *, gust_m_s: float, time_s: float) -> Trial:
    """Filter error as the documentation says, all options at their defaults."""
    record = flight(seed, gust_m_s, time_s)
    return fit_trial(lambda: fid.identify(model(), record, method="filter_error"), TRUTH)


CASES = (
    Case("filter error, no gust", partial(fly, gust_m_s=0.0, time_s=1.0)),
    Case("filter error, Dryden 0.3 s", partial(fly, gust_m_s=1.0, time_s=0.3)),
    Case("filter error, Dryden 1 s", partial(fly, gust_m_s=1.0, time_s=1.0)),
    Case("filter error, Dryden 4 s", partial(fly, gust_m_s=1.0, time_s=4.0)),
)
