"""Points of a fit by way of an excitation are not chosen and weighed by their own errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.identification.frequency_domain.selection import select_points
from flightid.identification.frequency_domain.steady_coherence import steady_coherence
from flightid.responses.estimators.conditioned import random_error

WINDOWS = 5
OMEGA = np.geomspace(1.0, 30.0, 60)


def measured(random: np.random.Generator, noise: float) -> fid.FrequencyResponse:
    """A response of one from a few windows, noise of an output between them."""
    u, v = (random.standard_normal((2, WINDOWS, len(OMEGA), 2)) @ [1.0, 1j]) * [[[1.0]], [[noise]]]
    y = u + v
    uu, uy, yy = (np.sum(a.conj() * b, axis=0) for a, b in ((u, u), (u, y), (y, y)))
    coherence = np.abs(uy) ** 2 / np.real(uu * yy)
    response = fid.FrequencyResponse.from_values(OMEGA, uy / uu, inputs=["u"], outputs=["y"])
    return replace(
        response,
        coherence=coherence[None, None],
        random_error=random_error(coherence, WINDOWS, 1)[None, None],
        estimator="instrument",
    )


def test_gains_do_not_lean_to_the_errors_that_raise_their_coherence() -> None:
    """The weighted mean of log gains, whose truth is zero but for what log makes of noise."""
    random = np.random.default_rng(0)
    plain, weighed = [], []
    for _ in range(150):
        response = measured(random, 0.8)
        (chosen,) = select_points(
            response,
            ("y/u",),
            bands=(1.0, 30.0),
            n_omega=60,
            minimum_coherence=None,
            weight_gain=1.0,
            weight_phase=1.0,
        )
        gains = np.log(np.abs(chosen.response))
        plain.append(np.mean(gains))
        weighed.append(np.sum(chosen.weight_db * gains) / np.sum(chosen.weight_db))
    # By their own coherence they lean by 0.068, 1.7 times the scatter of such a mean.
    assert abs(np.mean(weighed) - np.mean(plain)) < 0.03


@pytest.mark.parametrize("windows", [5.0, 50.0])
def test_the_end_of_a_sweep_and_a_notch_stay(windows: float) -> None:
    coherence = np.where(OMEGA < 15.0, 0.95, 0.05)
    notch = 20
    coherence[notch] = 0.1
    known = steady_coherence(OMEGA, coherence, random_error(coherence, windows, 1))
    assert np.all(known[OMEGA < 15.0].round(2) == coherence[OMEGA < 15.0].round(2))
    assert np.all(known[OMEGA >= 15.0] < 0.1)


def test_what_chance_does_not_explain_stays() -> None:
    rising = np.linspace(0.6, 0.99, len(OMEGA))
    few = steady_coherence(OMEGA, rising, random_error(rising, 4.0, 1))
    many = steady_coherence(OMEGA, rising, random_error(rising, 1e5, 1))
    nothing = steady_coherence(OMEGA, rising, np.zeros(len(OMEGA)))
    assert np.any(few != rising)
    assert np.mean(np.abs(many - rising)) < 0.01
    np.testing.assert_array_equal(nothing, rising)
