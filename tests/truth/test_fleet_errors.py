"""Errors of flights that few degrees of freedom tell, held beside those of a type."""

from __future__ import annotations

import numpy as np
import pytest

from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.moderated_errors import moderated_errors
from flightid.fleet.statistics.population import estimate_population
from flightid.uncertainty.quantiles import half_width


@pytest.mark.parametrize("freedom", [4.0, 8.0])
@pytest.mark.parametrize("apart", [0.0, 0.5])
def test_means_weighed_by_moderated_errors_are_as_sure_as_they_say(
    freedom: float, apart: float
) -> None:
    """By errors as stated, each as long as Student asks, 0.4 to 2 % lay beyond 3.5 of them.

    Means of six flights in a type of 72 of errors that are alike, or log-normal. Normal ones: 0.05.
    """
    rng, beyond, stderrs = np.random.default_rng(5), [], []
    for _ in range(250):
        true = np.exp(apart * rng.normal(size=72))
        stated = true * np.sqrt(rng.chisquare(freedom, 72) / freedom)
        values = true * rng.normal(size=72)
        weights = moderated_errors(stated, np.full(72, freedom)).reshape(12, 6) ** -2.0
        sums = np.sum(weights * values.reshape(12, 6), axis=1)
        beyond.append(np.abs(sums) / np.sqrt(np.sum(weights, axis=1)))
        stderrs.append(np.sum(weights, axis=1) ** -0.5)
    assert np.mean(np.array(beyond) > half_width(0.99)) == pytest.approx(0.01, abs=0.007)
    assert np.mean(np.array(beyond) > 3.5) <= 0.0025
    if apart == 0.0:  # Nothing is lost where all are alike.
        assert np.mean(stderrs) == pytest.approx(6.0**-0.5, rel=0.03)


def test_few_flights_and_known_errors_stand_as_they_are() -> None:
    known = np.array([1.0, 2.0, 3.0])
    assert moderated_errors(known, np.full(3, np.inf)).tolist() == known.tolist()
    wide = half_width(0.95, 5.0) / half_width(0.95)
    few = moderated_errors(known, np.array([5.0, np.inf, 5.0]))
    assert few == pytest.approx([wide, 2.0, 3.0 * wide])


def test_relative_errors_that_differ_leave_the_mean_where_it_is() -> None:
    """Where one flight in seven was no surer than half of itself, the mean was held in 21 %."""
    held = 0
    for seed in range(16):
        rng = np.random.default_rng(seed)
        truth = np.repeat(1.0 + 0.1 * rng.normal(size=20), 6)
        shares = 0.3 * np.exp(0.5 * rng.normal(size=120))
        values = truth * (1.0 + shares * rng.normal(size=120))
        ids = np.repeat([f"{i:02}" for i in range(20)], 6).tolist()
        told = ((shares * values) ** 2)[:, None, None]
        data = FlightEstimates.of(["a"], ids, values[:, None], told)
        low, high = estimate_population(data).parameters["a"].mean.interval95 or (np.inf, -np.inf)
        held += low <= 1.0 <= high
    assert held >= 13
