"""Closed-loop bias, shown and removed: direct against instrument estimate of the same flights."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import flightid as fid
from flightid.vehicles import Autopilot, Flight, RateGains, SidActivation, Turbulence, fly
from tests.strangers import loop_shifts

OMEGA = np.geomspace(1.5, 12.0, 8)
RUN = SidActivation(10, 3.0, 0.06, 0.2, 6.0, 2.0, 60.0, 1.0, leave_after_s=70.0)
GUSTY = Turbulence(rate_rad_s=0.5)
TIGHT = Autopilot(rate=(RateGains(p=0.14, i=0.14), RateGains(), RateGains(p=0.25, i=0.02, d=0.0)))
N_FLIGHTS = 8


@cache
def _flight(seed: int) -> Flight:
    return fly(runs=[RUN], turbulence=GUSTY, autopilot=TIGHT, log_every=4, seed=seed)


def _errors(method: str) -> NDArray[np.complex128]:
    """Relative errors of the roll response, shape (n_flights, n_frequencies)."""
    errors = []
    for seed in range(N_FLIGHTS):
        flight = _flight(seed)
        response = fid.estimate_response(
            flight.record((3.0, 72.0)),
            inputs="tau_phi",
            outputs="p",
            excitations="excitation" if method == "instrument" else None,
            omega_rad_s=OMEGA,
            window_s=12.0,
            estimator=method,
            covariance=False,
        )
        truth = flight.truth("roll").frequency_response(OMEGA)
        errors.append(response.response[0, 0] / truth - 1)
    return np.array(errors)


@pytest.fixture(scope="module")
def direct() -> NDArray[np.complex128]:
    return _errors("composite")


@pytest.fixture(scope="module")
def instrument() -> NDArray[np.complex128]:
    return _errors("instrument")


def test_direct_estimate_is_biased_where_gusts_reach_the_input(
    direct: NDArray[np.complex128],
) -> None:
    mean = direct.mean(axis=0)
    scatter = direct.std(axis=0) / np.sqrt(N_FLIGHTS)
    assert np.sum(np.abs(mean) > 5 * scatter) >= 4
    assert np.abs(mean).max() > 0.15


def test_instrument_removes_the_bias(
    direct: NDArray[np.complex128], instrument: NDArray[np.complex128]
) -> None:
    mean = instrument.mean(axis=0)
    scatter = instrument.std(axis=0) / np.sqrt(N_FLIGHTS)
    assert np.abs(mean).mean() < 0.35 * np.abs(direct.mean(axis=0)).mean()
    assert np.all(np.abs(mean) < 4 * scatter + 0.03)


@pytest.mark.slow
def test_claimed_shifts_are_those_that_are_there() -> None:
    ratios = []
    for family in loop_shifts.FAMILIES.values():
        claimed, there = loop_shifts.claimed_and_true(family, range(40))
        assert there
        ratios += [claimed[name] / there[name] for name in there]
    assert 0.5 <= np.median(ratios) <= 2.0, ratios
