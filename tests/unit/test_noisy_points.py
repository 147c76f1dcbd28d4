"""Fits by way of an excitation show no bars that the noise of their points makes short."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

import flightid as fid
from flightid.identification.frequency_domain.noisy_points import NOISY, VAGUE, without_vague
from flightid.identification.frequency_domain.selection import select_points
from tests.strangers.false_lights import flown, sweep
from tests.strangers.output_error import STEP_S, model

WIDE = {"band_rad_s": (3.0, 25.0), "minimum_coherence": 0.1}


@cache
def response(gust: float, seed: int = 3001) -> fid.FrequencyResponse:
    """A sweep of half a minute under a tight rate loop, by way of what was injected."""
    random = np.random.default_rng([seed, 14])
    injected = sweep(random, 1500)
    columns = flown(random, injected, gust=gust, gain=0.5, sensor=0.005)
    record = fid.Record.from_arrays(
        np.arange(injected.size) * STEP_S,
        inputs={"da": columns["da"]},
        outputs={"p": columns["p"]},
        excitations={"da_injected": injected},
        units={"da": "rad", "p": "rad/s", "da_injected": "rad"},
        hold="zero",
        loop="closed",
    )
    return fid.estimate_response(record, estimator="instrument")


def codes(fit: fid.Fit) -> set[str]:
    return {each.code for each in fit.findings}


def test_a_likelihood_weighs_no_points_by_chance() -> None:
    fit = fid.identify(model(), response(0.01), cost="likelihood", **WIDE)
    assert "weighed-by-chance" in codes(fit)
    assert all(each.interval95 is None for each in fit.parameters.values())
    assert all("coherence below 0.6" in each.reason for each in fit.parameters.values())


def test_a_likelihood_of_coherent_points_has_intervals() -> None:
    for chosen in ({}, WIDE):
        fit = fid.identify(model(), response(0.0), cost="likelihood", **chosen)
        assert "weighed-by-chance" not in codes(fit)
        assert all(each.interval95 for each in fit.parameters.values())


def test_only_what_noisy_points_tell_vaguely_has_no_interval() -> None:
    data = response(0.01, 3005)
    fit = fid.identify(model(), data)
    omega = fit.responses[0].omega_rad_s
    error = data.random_error[0, 0][np.isin(data.omega_rad_s, omega)]
    assert np.median(error) > NOISY
    lp, control = fit.parameters["Lp"], fit.parameters["Lda"]
    assert fit.covariance is not None
    size = np.sqrt(np.diag(fit.covariance))[[fit.names.index(n) for n in ("Lp", "Lda")]]
    assert size[0] > VAGUE * abs(lp.value)
    assert size[1] < VAGUE * abs(control.value)
    assert lp.interval95 is None
    assert "60 % of the value" in lp.reason
    assert control.interval95 is not None
    assert "known-vaguely" in codes(fit)


def test_calm_air_leaves_a_small_parameter_its_interval() -> None:
    calm, shaken = response(0.0), response(0.01)
    fit = fid.identify(model(), calm)
    known = fit.parameters["Lp"]
    assert known.stderr is not None
    small = replace(known, value=known.stderr)
    near_zero = replace(fit, parameters={**fit.parameters, "Lp": small})
    points = select_points(
        calm,
        ("p/da",),
        bands=None,
        n_omega=20,
        minimum_coherence=0.6,
        weight_gain=1.0,
        weight_phase=0.01745,
    )
    assert without_vague(near_zero, calm, points) is near_zero
    noisy = [replace(each, measured=shaken.pair("p", "da")) for each in points]
    bare = without_vague(near_zero, shaken, noisy)
    assert bare.parameters["Lp"].interval95 is None
    assert bare.parameters["Lda"].interval95 is not None
