"""Fleets whose flights tell more or less, with SciPy's fit of each flight by itself."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.joint_fit import FlightPoints, MeasuredPoints
from flightid.fleet.statistics.population import Population, estimate_population

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


def by_fits(flights: list[FlightPoints], *, errors_at_type: bool = True) -> Population:
    """The type by each flight's own fit."""
    return estimate_population(
        FlightEstimates.of(
            NAMES,
            [each.vehicle for each in flights],
            [each.estimate for each in flights],
            [each.covariance for each in flights],
        ),
        errors_at_type=errors_at_type,
    )


def information(error: float, top: float) -> np.ndarray:
    """What one flight tells of the four parameters about their means, shared errors counted."""
    omega = np.geomspace(2.0, top, 45)
    slopes = []
    for i in range(4):
        step = np.zeros(4)
        step[i] = 1e-6 * MEAN[i]
        ratio = response(MEAN + step, omega) / response(MEAN - step, omega)
        slopes.append(np.log(ratio) / (2.0 * step[i]))
    found = np.real(np.conj(slopes) @ np.transpose(slopes)) / error**2 / SHARED
    return np.asarray(found + np.diag(1e-6 / SPREAD**2))


def linear_fleet(
    seed: int, vehicles: int, errors: tuple[float, ...], tops: tuple[float, ...]
) -> FlightEstimates:
    """Estimates that `fleet` would give were responses linear in the parameters: quick to draw."""
    rng = np.random.default_rng(seed)
    covariances = [np.linalg.inv(information(*each)) for each in zip(errors, tops, strict=True)]
    values = []
    for _ in range(vehicles):
        truth = MEAN + SPREAD * rng.normal(size=4)
        values += [truth + np.linalg.cholesky(each) @ rng.normal(size=4) for each in covariances]
    names = np.repeat([f"{i:02}" for i in range(vehicles)], len(errors)).tolist()
    return FlightEstimates.of(NAMES, names, values, covariances * vehicles)
