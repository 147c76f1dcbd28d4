"""Sweeps that a pilot flies while steadying the vehicle: what he adds was not logged."""

from __future__ import annotations

from functools import partial

import numpy as np

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial

STEP_S = 0.02
TRUTH = {"Lp": -3.0, "Llat": 12.0, "Zw": -0.7, "Zcol": -9.0}
GUST = {"p": 1.0, "w": 3.0}
"""Accelerations of gusts, root mean square over a step of 0.02 s as white noise."""
PILOT = 0.12
"""Collective for each m/s of heave that he answers after 0.1 s."""
Array = noises.Array


def swept(n: int, low: float = 0.4, high: float = 12.0) -> Array:
    """Logarithmic sweep (rad/s)."""
    t = np.arange(n) * STEP_S
    rate = np.log(high / low) / t[-1]
    return np.sin(low * (np.exp(rate * t) - 1.0) / rate)


def record(seed: int, *, feedback: float, duration_s: float = 90.0) -> list[fid.Record]:
    """One sweep of each control; heave alone is fed back."""
    found = []
    for driven in range(2):
        random = np.random.default_rng([seed, driven])
        n = round(duration_s / STEP_S)
        gust = [GUST["p"], GUST["w"]] * random.standard_normal((n, 2))
        hands = 0.02 * noises.ar1(random, n, 0.95), 0.02 * noises.ar1(random, n, 0.95)
        drive = [0.15 * swept(n) * (driven == k) + hands[k] for k in range(2)]
        decay = np.exp(np.array([TRUTH["Lp"], TRUTH["Zw"]]) * STEP_S)
        push = (decay - 1.0) / np.array([TRUTH["Lp"], TRUTH["Zw"]])
        gains = np.array([TRUTH["Llat"], TRUTH["Zcol"]])
        noise = ([0.005, 0.02] * random.standard_normal((n, 2))).tolist()
        (kept_p, kept_w), (push_p, push_w) = decay.tolist(), push.tolist()
        (gain_p, gain_w), rows, p, w, held = gains.tolist(), [], 0.0, 0.0, 0.0
        for lat, col, (of_p, of_w), (gust_p, gust_w) in zip(
            *(each.tolist() for each in drive), noise, gust.tolist(), strict=True
        ):
            held += STEP_S / 0.1 * (feedback * (w + of_w) - held)
            rows.append((p + of_p, w + of_w, lat, col + held))
            p = kept_p * p + push_p * (gain_p * lat + gust_p)
            w = kept_w * w + push_w * (gain_w * (col + held) + gust_w)
        y, u = np.split(np.array(rows).T, 2)
        found.append(
            fid.Record.from_arrays(
                np.arange(n) * STEP_S,
                inputs={"lat": u[0], "col": u[1]},
                outputs={"p": y[0], "w": y[1]},
                units={"lat": "rad", "col": "rad", "p": "rad/s", "w": "m/s"},
                hold="zero",
            )
        )
    return found


def model() -> fid.StateSpaceModel:
    """Roll and heave, each of first order, started some way off."""
    units = {"Lp": "1/s", "Llat": "1/s^2", "Zw": "1/s", "Zcol": "m/s^2"}
    parameters = [fid.Parameter(name, 1.2 * TRUTH[name], unit) for name, unit in units.items()]
    return fid.StateSpaceModel(
        states={"p": "rad/s", "w": "m/s"},
        input_units={"lat": "rad", "col": "rad"},
        equations={"p'": "Lp*p + Llat*lat", "w'": "Zw*w + Zcol*col"},
        measurements={"p": fid.Output("p", "rad/s"), "w": fid.Output("w", "m/s")},
        parameters=fid.Parameters(parameters),
    ).with_responses("p/lat", "w/col")


def fly(seed: int, *, feedback: float, estimator: str) -> Trial:
    """Responses of both sweeps together, and the fit to them."""
    flown = record(seed, feedback=feedback)

    def fit() -> fid.Fit:
        response = fid.estimate_response(flown, estimator=estimator, band_rad_s=(0.5, 10.0))
        return fid.identify(model(), response)

    return fit_trial(fit, TRUTH)


def fly_jointly(seed: int, *, feedback: float, estimator: str) -> Trial:
    """The response of both sweeps beside two more of them as records."""
    flown, beside = (record(2 * seed + k, feedback=feedback) for k in range(2))

    def fit() -> fid.Fit:
        response = fid.estimate_response(flown, estimator=estimator, band_rad_s=(0.5, 10.0))
        return fid.identify(model(), [response, *beside])

    return fit_trial(fit, TRUTH)


CASES = tuple(
    Case(f"{kind}, {name}, {estimator}", partial(way, feedback=feedback, estimator=estimator))
    for kind, way in (("piloted sweeps", fly), ("piloted sweeps joint", fly_jointly))
    for name, feedback in (("hands off", 0.0), ("heave held", PILOT))
    for estimator in ("composite", "prewhitened")
)
