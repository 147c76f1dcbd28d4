"""Readings off estimated responses: margins, disturbance rejection, attitude bandwidth."""

from __future__ import annotations

import time
from functools import cache, partial
from typing import Any

import numpy as np
from scipy.linalg import expm

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Reading, Trial
from tests.strangers.responses import STEP_S, held, sweep

Array = noises.Array
BAND = (0.8, 25.0)
FINE = 6000
READ = ("crossover", "phase_margin", "delay_margin", "gain_margin", "phase_crossover")


def vehicle(light: bool) -> tuple[list[list[float]], list[float], list[list[float]]]:
    """Roll rate behind a motor's lag; with a slung load's light mode where asked."""
    if not light:
        return [[-3.0, 40.0, 0.0], [0.0, -12.0, 12.0], [0.0, 0.0, -25.0]], [0, 0, 25.0], [[1, 0, 0]]
    a = [
        [-3.0, 40.0, 0.0, -4.0, 0.0],
        [0.0, -12.0, 12.0, 0.0, 0.0],
        [0.0, 0.0, -25.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0, -9.0, -0.3],
    ]
    return a, [0, 0, 25.0, 0, 0], [[1, 0, 0, 0, 0]]


def exact(omega: Array, light: bool) -> Array:
    """Response between samples of the held input."""
    a, b, c = (np.array(each, dtype=float) for each in vehicle(light))
    n = len(a)
    both = expm(np.block([[a, b[:, None]], [np.zeros((1, n + 1))]]) * STEP_S)
    z = np.exp(1j * omega * STEP_S)[:, None, None]
    solved = np.linalg.solve(
        z * np.eye(n) - both[:n, :n], np.tile(both[:n, n:], (len(omega), 1, 1))
    )
    return np.asarray((c @ solved)[:, 0, 0])


def controller(s: Array) -> Array:
    """A PI law."""
    return 0.9 * (1.0 + 1.5 / s)


def read(response: fid.FrequencyResponse) -> dict[str, Any]:
    """All numbers that are read off one response, as estimates."""
    margins = fid.margins(response, controller=controller)
    rejection = fid.disturbance_rejection(response, controller=controller)
    found: dict[str, Any] = {name: getattr(margins, name) for name in READ}
    found["disturbance bandwidth"] = rejection.bandwidth
    found["disturbance peak"] = rejection.peak
    disk = fid.disk_margin(response, controller=lambda s: 0.25 * controller(s))
    found |= {"disk margin": disk.alpha, "disk frequency": disk.frequency}
    try:
        handling = fid.attitude_bandwidth(response, "u", "p", band_rad_s=BAND, output_is="rate")
    except fid.FlightidError:
        return found
    for place, name in enumerate(("omega_180", "phase_bandwidth", "gain_bandwidth", "phase_delay")):
        found[name] = handling.uncertain.number(place, name)
    return found


@cache
def truth(light: bool) -> dict[str, float | None]:
    """The same numbers off the exact response on a fine grid."""
    omega = np.geomspace(*BAND, FINE)
    given = fid.FrequencyResponse.from_values(
        omega, exact(omega, light), inputs=["u"], outputs=["p"]
    )
    return {name: each.value for name, each in read(given).items()}


def fly_readings(
    seed: int,
    *,
    duration_s: float,
    estimator: str = "composite",
    light: bool = False,
    roughness: float = 0.05,
    colour: float = 0.0,
) -> Trial:
    """One sweep, its response, and every number read off it."""
    random = np.random.default_rng(seed)
    n = round(duration_s / STEP_S)
    u = sweep(n, 0.6, 28.0)
    y = held(*vehicle(light), u)[0]
    record = fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"u": u},
        outputs={"p": y + roughness * y.std() * noises.ar1(random, n, colour)},
        units={"u": "1", "p": "rad/s"},
        hold="zero",
    )
    begun = time.perf_counter()
    response = fid.estimate_response(record, band_rad_s=BAND, n_omega=80, estimator=estimator)
    found = read(response)
    readings = [
        Reading(name, float(true), float(each.value), each.stderr, each.interval95)
        for name, true in truth(light).items()
        if true is not None and (each := found.get(name)) is not None and each.value is not None
    ]
    return Trial(tuple(readings), "", time.perf_counter() - begun)


CASES = tuple(
    Case(
        f"readings, {estimator}, {'light mode, ' if light else ''}{duration_s:.0f} s{noise}",
        partial(
            fly_readings,
            duration_s=duration_s,
            estimator=estimator,
            light=light,
            roughness=roughness,
            colour=colour,
        ),
    )
    for estimator, duration_s, light, roughness, colour, noise in (
        ("composite", 60.0, False, 0.05, 0.0, ""),
        ("composite", 60.0, False, 0.2, 0.9, ", AR(1) 0.9"),
        ("composite", 60.0, True, 0.05, 0.0, ""),
        ("composite", 20.0, False, 0.05, 0.0, ""),
        ("local_polynomial", 20.0, False, 0.05, 0.0, ""),
        ("local_polynomial", 60.0, True, 0.05, 0.0, ""),
    )
)
