"""A type from responses of all its flights together, against SciPy's fits of each by itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from flightid.errors import DataError, FitError
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.joint_fit import FlightPoints, MeasuredPoints, fit_population
from flightid.fleet.statistics.population import Population, estimate_population
from flightid.models.load import load_structure

MODEL = load_structure("rate_motor_lag", axis="roll")
MEAN = np.array([140.0, -3.4, 0.045, 0.012])
SPREAD = np.array([0.1, 0.15, 0.1, 0.1]) * np.abs(MEAN)
NAMES = ("Ltphi", "Lp", "T_m", "tau")
SHARED = 3.0
"""Errors of points come in runs of three: they tell a third of what they seem to."""


def response(values: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """The model by hand: gain, damping, motor lag, delay."""
    gain, damping, lag, delay = values
    s = 1j * omega
    return np.asarray(gain * np.exp(-s * delay) / ((s - damping) * (lag * s + 1.0)))


def own_fit(omega: np.ndarray, measured: np.ndarray, error: float) -> tuple[np.ndarray, np.ndarray]:
    """A flight by itself, by SciPy; covariance with the points' shared errors."""

    def apart(scaled: np.ndarray) -> np.ndarray:
        found = np.log(measured / response(scaled * MEAN, omega)) / error
        return np.concatenate([found.real, found.imag])

    bounds = ([0.05, -1.0, 0.1, 0.0], [9.0, 8.0, 3.0, 9.0])
    done = least_squares(apart, np.ones(4), bounds=bounds)
    covariance = SHARED * np.linalg.inv(done.jac.T @ done.jac + 1e-8 * np.eye(4))
    return done.x * MEAN, covariance * np.outer(MEAN, MEAN)


def fleet(
    seed: int, vehicles: int, flights: int, errors: tuple[float, ...], tops: tuple[float, ...]
) -> list[FlightPoints]:
    """Flights in turn with these errors and highest frequencies."""
    rng = np.random.default_rng(seed)
    made = []
    for vehicle in range(vehicles):
        truth = MEAN + SPREAD * rng.normal(size=4)
        for flight in range(flights):
            error, top = errors[flight % len(errors)], tops[flight % len(tops)]
            omega = np.geomspace(2.0, top, 45)
            draws = (rng.normal(size=15) + 1j * rng.normal(size=15)).repeat(3)
            measured = response(truth, omega) * np.exp(error * draws)
            points = MeasuredPoints(omega, measured, np.full(45, error))
            value, covariance = own_fit(omega, measured, error)
            name = f"{vehicle:02}"
            made.append(FlightPoints(name, name, {"p/tau_phi": points}, value, covariance))
    return made


def by_fits(flights: list[FlightPoints]) -> Population:
    return estimate_population(
        FlightEstimates.of(
            NAMES,
            [each.vehicle for each in flights],
            [each.estimate for each in flights],
            [each.covariance for each in flights],
        )
    )


def test_of_flights_that_tell_all_it_is_the_mean_of_their_fits() -> None:
    flights = fleet(1, 8, 2, (0.02,), (60.0,))
    joint, apart = fit_population(MODEL, flights, "quad"), by_fits(flights)
    stderr = np.sqrt(np.diag(apart.spreads.mean_covariance))
    assert np.max(np.abs(joint.spreads.mean - apart.spreads.mean) / stderr) < 0.1
    ratio = np.sqrt(np.diag(joint.spreads.between) / np.diag(apart.spreads.between))
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)
    # Errors that its fit found three times as large count three times.
    bolder = [
        FlightPoints(e.vehicle, e.flight, e.responses, e.estimate, e.covariance / 9.0)  # type: ignore[operator]
        for e in flights
    ]
    sizes = [np.diag(each.data.covariances[0]) for each in (joint, fit_population(MODEL, bolder))]
    np.testing.assert_allclose(sizes[0] / sizes[1], 9.0, rtol=0.05)


def test_it_refuses_what_tells_nothing() -> None:
    flights = fleet(1, 2, 1, (0.02,), (60.0,))
    strange = [
        FlightPoints(e.vehicle, e.flight, {"q/tau_theta": e.responses["p/tau_phi"]}, e.estimate)
        for e in flights
    ]
    with pytest.raises(DataError, match="no flight has a response"):
        fit_population(MODEL, strange)


def means(seeds: range) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of the mean by both ways, and whether the joint interval held it; every other weak."""
    joint, apart, held = [], [], []
    for seed in seeds:
        flights = fleet(seed, 8, 2, (0.05, 0.25), (60.0, 15.0))
        found, usual = fit_population(MODEL, flights), by_fits(flights)
        joint.append(found.spreads.mean - MEAN)
        apart.append(usual.spreads.mean - MEAN)
        ends = [found.parameters[name].mean.interval() or (0.0, 0.0) for name in NAMES]
        held.append([low <= m <= high for (low, high), m in zip(ends, MEAN, strict=True)])
    return np.array(joint), np.array(apart), np.array(held)


@pytest.mark.slow
def test_its_intervals_hold_where_half_of_the_flights_tell_little() -> None:
    joint, apart, held = means(range(100, 130))
    assert np.all(np.mean(held, axis=0) > 0.85), np.mean(held, axis=0)
    assert np.mean(held) == pytest.approx(0.95, abs=0.03)
    size = [np.sqrt(np.mean(each**2, axis=0)) for each in (joint, apart)]
    assert np.all(size[0] < 1.05 * size[1]), size


@pytest.mark.slow
def test_it_gains_where_three_of_four_flights_are_short() -> None:
    """Of 40 fleets 38 settle, errors of means are 0.81, 0.93, 0.86 and 0.80 of pooled fits'."""
    errors, held = [], []
    for seed in range(100, 140):
        flights = fleet(seed, 8, 4, (0.05, 0.25, 0.25, 0.25), (60.0, 10.0, 10.0, 10.0))
        try:
            found = fit_population(MODEL, flights)
        except FitError:
            continue
        errors.append([found.spreads.mean - MEAN, by_fits(flights).spreads.mean - MEAN])
        following = MEAN + SPREAD * np.random.default_rng(10**6 + seed).normal(size=4)
        for name, truth, spread in zip(NAMES, following, SPREAD, strict=True):
            one = found.parameters[name]
            ends = [each.interval95 or (0.0, 0.0) for each in (one.next_vehicle, one.spread)]
            told = zip(ends, (truth, spread), strict=True)
            held.append([low <= value <= high for (low, high), value in told])
    assert len(errors) >= 36
    joint, pooled = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all(joint < 0.97 * pooled), joint / pooled
    assert np.all(np.mean(held, axis=0) > 0.9), np.mean(held, axis=0)
