"""95 % intervals of the regression methods and of filter error cover 93 to 97 of 100 flights."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid import _native
from tests.regression_flights import DEVIATIONS, fly, noisy, short_period, values

FLIGHTS = 200
BAND = {"band_rad_s": (0.0, 15.0)}
GUSTS = np.array([0.03, 0.15])
"""Deviations of the noise on the derivatives of angle of attack and pitch rate, per √Hz."""


def _share(flights: list[fid.Record], model: fid.StateSpaceModel, **options: object) -> float:
    inside = []
    for flight in flights:
        fit = fid.identify(model, flight, **options)  # type: ignore[call-overload]
        for name, value in values(model).items():
            low, high = fit.parameters[name].interval95
            inside.append(low <= value <= high)
    return float(np.mean(inside))


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"method": "equation_error"},
        {"method": "fourier_regression", **BAND},
        {"method": "fourier_output_error", **BAND},
    ],
    ids=lambda options: options["method"],
)
def test_intervals_cover_the_truth_in_calm_air(options: dict[str, object]) -> None:
    model = short_period()
    calm = fly(model)
    share = _share([noisy(calm, seed) for seed in range(FLIGHTS)], model, **options)
    assert 0.93 <= share <= 0.97, share


def in_turbulence(
    calm: fid.Record, model: fid.StateSpaceModel, seed: int, time_constant_s: float = 0.0
) -> fid.Record:
    """Process noise on both derivatives, four steps in a sample, and noise on the outputs.

    White, or of first order with the same density at low frequency.
    """
    a, _, c, _, _ = model.state_space()
    generator = np.random.default_rng(seed)
    step = calm.sample_time_s / 4
    count = 4 * (calm.n_samples - 1) + 1
    forced = generator.standard_normal((1, count, 2)) * GUSTS * np.sqrt(step)
    if time_constant_s:
        pole = np.exp(-step / time_constant_s)
        forced = lfilter([1.0 - pole], [1.0, -pole], forced, axis=1)
    phi = _native.matrix_exponential(np.ascontiguousarray(a * step))
    shaken = _native.linear_recursion(phi, forced, np.zeros((1, 2)))[0, ::4] @ c.T
    outputs = {
        name: calm[name]
        + shaken[:, k]
        + 3.0 * DEVIATIONS[name] * generator.standard_normal(calm.n_samples)
        for k, name in enumerate(model.outputs)
    }
    return calm.replace(outputs)


@pytest.mark.slow
def test_filter_error_covers_the_truth_in_turbulence() -> None:
    model = short_period(tau=0.02)
    calm = fly(model)
    flights = [in_turbulence(calm, model, seed) for seed in range(FLIGHTS)]
    share = _share(flights, model, method="filter_error")
    assert 0.93 <= share <= 0.97, share


def test_a_gust_that_is_no_white_noise_widens_the_intervals() -> None:
    """A filter for white noise is biased by it: the light says so, and the bars grow."""
    model = short_period(tau=0.02)
    calm = fly(model)
    white, gust = (
        fid.identify(
            model, in_turbulence(calm, model, 0, tau), method="filter_error", gust_states=False
        )
        for tau in (0.0, 0.3)
    )
    codes = [{each.code for each in fit.findings} for fit in (white, gust)]
    assert "residuals-coloured" not in codes[0]
    assert "residuals-coloured" in codes[1]
    assert gust.parameters["Malpha"].freedom < 0.2 * white.parameters["Malpha"].freedom


@pytest.mark.nightly
def test_filter_error_beats_output_error_in_turbulence() -> None:
    model = short_period(tau=0.02)
    calm = fly(model)
    truth = values(model)
    errors: dict[str, list[list[float]]] = {"filter_error": [], "output_error": []}
    options = {"filter_error": {"gust_states": False}, "output_error": {}}
    for seed in range(4):
        flight = in_turbulence(calm, model, seed)
        for method, found in errors.items():
            fit = fid.identify(model, flight, method=method, **options[method])
            found.append([fit.parameters[name].value / truth[name] - 1.0 for name in truth])
    spread = {method: np.sqrt(np.mean(np.square(found))) for method, found in errors.items()}
    assert spread["filter_error"] < 0.7 * spread["output_error"], spread
