"""A type from the measured responses of all its flights at once: population and fits in one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FitError, ModelError
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.population import Population, estimate_population
from flightid.frozen import dataclass
from flightid.identification.frequency_domain.model_curves import curves_of, log_slopes_of
from flightid.models import GreyBoxModel

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
MOST_ROUNDS = 30
SETTLED = 0.02
"""Largest movement of a mean between two rounds, in its standard errors."""
RIDGE = 1e-6
"""What a flight that tells nothing of a direction counts for: share of the spread's weight."""


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """One response of one flight at the points that its fit used.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n,)
    values : ndarray of complex, shape (n,)
    random_error : ndarray, shape (n,)
        Standard error of the magnitude, share of it; that of the phase, rad, is as large.
    """

    omega_rad_s: Array
    values: Complex
    random_error: Array


@dataclass(frozen=True, eq=False)
class FlightPoints:
    """What one flight measured, with the estimate of its own fit.

    Attributes
    ----------
    vehicle, flight : str
    responses : mapping of str to MeasuredPoints
        By the model's names: ``"p/tau_phi"``.
    estimate : ndarray, shape (p,)
        Of the model's free parameters.
    covariance : ndarray, shape (p, p), or None
        Of it: how far points share errors is read from it. None: as the other flights.
    """

    vehicle: str
    flight: str
    responses: Mapping[str, MeasuredPoints]
    estimate: Array
    covariance: Array | None = None


def fit_population(
    model: GreyBoxModel, flights: Sequence[FlightPoints], type_name: str = ""
) -> Population:
    """Fit the responses of all flights of a type together, with spread between vehicles.

    Each flight's responses are linearised where the population, as it stands, and the flight itself
    put its parameters; mean and spreads follow by restricted likelihood, and both are repeated
    until the mean settles. A flight that tells a parameter badly by itself still counts with what
    it tells, and its weight is that of its place in the population, not of its own errors.

    Parameters
    ----------
    model : TransferFunctionModel or StateSpaceModel
        Structure, its free parameters those of every flight's estimate.
    flights : sequence of FlightPoints
    type_name : str
        For words.

    Returns
    -------
    Population

    Raises
    ------
    DataError
        No flight has a response of the model, or fewer than two vehicles have.
    ModelError
        An estimate of another length than the model has free parameters.
    FitError
        The mean does not settle.

    Assumes
    -------
    Normal vehicles and errors; linear about each flight's place, to first order. Errors of points
    are shared between neighbours alike for all parameters: one factor a flight, from the covariance
    of its own fit. Biased where spreads are so wide that responses bend within one.

    Reference
    ---------
    Lindstrom & Bates, *Biometrics* 46 (1990), 673–687.
    """
    names = tuple(each.name for each in model.parameters.free)
    known = [each for each in flights if _told(model, each)]
    if any(each.estimate.shape != (len(names),) for each in known):
        raise ModelError(
            "estimates of flights are not those of the model",
            needed=f"{len(names)} numbers: {', '.join(names)}",
        )
    if not known:
        raise DataError(
            "no flight has a response of the model", needed=", ".join(model.response_names)
        )
    places = [each.estimate for each in known]
    factors = _factors(model, known)
    weight = _weight(np.array(places))
    before: Array | None = None
    for _ in range(MOST_ROUNDS):
        data = _linearised(model, known, places, factors, weight)
        found = estimate_population(data, type_name, errors_at_type=False)
        mean = found.spreads.mean
        stderr = np.sqrt(np.diag(found.spreads.mean_covariance))
        if before is not None and np.max(np.abs(mean - before) / stderr) < SETTLED:
            return found
        before = mean
        places = _modes(found, data)
    raise FitError(
        "the mean of a type does not settle",
        found=f"{MOST_ROUNDS} rounds over {len(known)} flights",
        action="pool the fits of the flights: estimate_population",
    )


def _told(model: GreyBoxModel, flight: FlightPoints) -> bool:
    return any(name in flight.responses for name in model.response_names)


def _weight(estimates: Array) -> Array:
    """A little information along every parameter, so that none is infinitely uncertain."""
    scale = np.maximum(np.std(estimates, axis=0), 1e-3 * np.abs(np.mean(estimates, axis=0)))
    return np.diag(RIDGE / np.maximum(scale, 1e-300) ** 2)


def _information(model: GreyBoxModel, flight: FlightPoints, place: Array) -> tuple[Array, Array]:
    """Information and score of a flight's points at a place, points taken for independent."""
    free = (each.name for each in model.parameters.free)
    at: GreyBoxModel = model.with_values(dict(zip(free, map(float, place), strict=True)))
    points = [flight.responses.get(name) for name in at.response_names]
    grids = [np.ones(1) if each is None else each.omega_rad_s for each in points]
    size = len(place)
    information, score = np.zeros((size, size)), np.zeros(size)
    for measured, curve, slope in zip(
        points, curves_of(at, grids), log_slopes_of(at, grids), strict=True
    ):
        if measured is None:
            continue
        apart = np.log(measured.values / curve)
        weighted = slope.conj() / measured.random_error[:, None] ** 2
        information += np.real(weighted.T @ slope)
        score += np.real(weighted.T @ apart)
    return information, score


def _factors(model: GreyBoxModel, flights: Sequence[FlightPoints]) -> list[float]:
    """How much less each flight's points tell than as many independent ones: its own fit knows."""
    found = []
    for each in flights:
        information, _ = _information(model, each, _inside(model, each.estimate))
        sign, size = np.linalg.slogdet(information)
        factor = np.nan
        if each.covariance is not None and sign > 0.0:
            sign, own = np.linalg.slogdet(each.covariance)
            factor = np.exp((size + own) / len(each.estimate)) if sign > 0.0 else np.nan
        found.append(float(factor))
    known = [each for each in found if np.isfinite(each)]
    usual = float(np.median(known)) if known else 1.0
    return [each if np.isfinite(each) else usual for each in found]


def _linearised(
    model: GreyBoxModel,
    flights: Sequence[FlightPoints],
    places: Sequence[Array],
    factors: Sequence[float],
    weight: Array,
) -> FlightEstimates:
    """Estimates that the points of each flight stand for, seen from its place."""
    values, covariances = [], []
    for flight, place, factor in zip(flights, places, factors, strict=True):
        inside = _inside(model, place)
        information, score = _information(model, flight, inside)
        covariance = np.linalg.inv(information / factor + weight)
        values.append(inside + covariance @ score / factor)
        covariances.append(0.5 * (covariance + covariance.T))
    names = tuple(each.name for each in model.parameters.free)
    return FlightEstimates.of(
        names,
        [each.vehicle for each in flights],
        values,
        covariances,
        units=[model.parameters[name].unit for name in names],
        flights=[each.flight for each in flights],
    )


def _modes(found: Population, data: FlightEstimates) -> list[Array]:
    """Where population and flight together put the parameters of each flight."""
    spread = found.spreads.between
    if found.spreads.within is not None:
        spread = spread + found.spreads.within
    mean = found.spreads.mean
    return [
        np.asarray(mean + spread @ np.linalg.solve(spread + covariance, value - mean))
        for value, covariance in zip(data.values, data.covariances, strict=True)
    ]


def _inside(model: GreyBoxModel, place: Array) -> Array:
    """A place within the bounds of the model."""
    free = model.parameters.free
    return np.clip(place, [each.minimum for each in free], [each.maximum for each in free])
