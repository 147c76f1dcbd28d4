"""Spreads between vehicles, and between flights of one, of the highest restricted likelihood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from flightid.errors import DataError, FitError
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.restricted_likelihood import Evaluation, RestrictedLikelihood
from flightid.fleet.statistics.spread import (
    SpreadOfSome,
    SpreadStructure,
    flights_spread,
    supported,
)
from flightid.frozen import dataclass

Array = NDArray[np.float64]
FEWEST = 2
NEGLIGIBLE = 1e-4
"""Share of the scatter of estimates below which a spread counts as none."""
STARTS = (1.0, 0.2)
"""Multiples of the spread that the estimates themselves show, from which searches begin."""
MANY = 500
"""Flights from which one start will do."""


@dataclass(frozen=True, eq=False)
class SpreadFit:
    """Spreads with what follows of them, in the units of the estimates.

    Attributes
    ----------
    mean : ndarray, shape (p,)
    mean_covariance : ndarray, shape (p, p)
    between : ndarray, shape (p, p)
        T, between vehicles.
    within : ndarray, shape (p, p), or None
        F, between flights of one vehicle beyond the errors of the fits; None where too few
        flights tell it, and 0 of parameters that too few tell.
    within_told : ndarray of bool, shape (p,)
        Parameters whose F was searched.
    structure, within_structure : str
        Shapes that were searched.
    information : ndarray, shape (k, p, p)
        Of each vehicle, in the order of `FlightEstimates.members`.
    score : ndarray, shape (k, p)
    cost : float
        −2 log restricted likelihood of the scaled estimates.
    evaluations : int
    """

    mean: Array
    mean_covariance: Array
    between: Array
    within: Array | None
    within_told: NDArray[np.bool_]
    structure: str
    within_structure: str
    information: Array
    score: Array
    cost: float
    evaluations: int

    def vehicle(self, place: int) -> tuple[Array, Array, NDArray[np.bool_]]:
        """A vehicle's own estimate, its covariance, and which parameters its flights told."""
        told = np.diag(self.information[place]) > 0.0
        covariance = np.zeros_like(self.information[place])
        covariance[np.ix_(told, told)] = np.linalg.inv(self.information[place][np.ix_(told, told)])
        return covariance @ self.score[place], covariance, told


def search_spreads(
    data: FlightEstimates, *, structure: str | None = None, within_structure: str | None = None
) -> SpreadFit:
    """Maximise the restricted likelihood over the spreads.

    Parameters
    ----------
    data : FlightEstimates
    structure, within_structure : str, optional
        ``"diagonal"``, ``"factor"`` or ``"full"``; default: what the number of vehicles, and of
        repeated flights, supports. ``within_structure="none"``: flights of one vehicle differ by
        the errors of their fits alone.

    Returns
    -------
    SpreadFit

    Raises
    ------
    DataError
        Fewer than two vehicles, or a parameter that fewer than two tell.
    FitError
        No search ended in finite numbers.
    OptionError
        No such structure.

    Reference
    ---------
    Byrd, Lu, Nocedal & Zhu, *SIAM J. Sci. Comput.* 16 (1995), 1190–1208 (the search).
    """
    _require_vehicles(data)
    p, k = len(data.names), len(data.members)
    between = SpreadStructure(structure or supported(p, k - 1), p)
    within = _within(data, within_structure)
    centre, scale, spread = _scales(data)
    likelihood = RestrictedLikelihood.of(_scaled(data, centre, scale))
    starts = STARTS if len(data.vehicles) < MANY else STARTS[:1]
    ends = [_searched(likelihood, between, within, share * spread / scale) for share in starts]
    sound = [end for end in ends if np.isfinite(end.at.cost)]
    if not sound:
        raise FitError(
            "no search for the spread of a fleet ended in finite numbers",
            found=f"{len(data.vehicles)} flights of {k} vehicles",
            action="look at the estimates: one may be far from all others",
        )
    best = min(sound, key=lambda end: end.at.cost)
    outer = np.outer(scale, scale)
    information = best.at.information / outer
    return SpreadFit(
        centre + scale * best.at.mean,
        np.linalg.inv(best.at.mean_information) * outer,
        _trimmed(best.between) * outer,
        None if best.within is None else _trimmed(best.within) * outer,
        _searched_places(within, p),
        between.kind,
        "none" if within is None else within.of_those.kind,
        information,
        best.at.score / scale + information @ centre,
        best.at.cost,
        sum(end.evaluations for end in ends),
    )


@dataclass(frozen=True, eq=False)
class SpreadSearchEnd:
    """Where one search ended, in scaled units."""

    at: Evaluation
    between: Array
    within: Array | None
    evaluations: int


def _within(data: FlightEstimates, structure: str | None) -> SpreadOfSome | None:
    """Shape of the spread between flights: as told, of all parameters, or as repeats support."""
    if structure is None:
        return flights_spread(data)
    p = len(data.names)
    told = None if structure == "none" else SpreadStructure(structure, p)
    return None if told is None else SpreadOfSome(told, tuple(range(p)), p)


def _searched_places(within: SpreadOfSome | None, p: int) -> NDArray[np.bool_]:
    return np.isin(np.arange(p), () if within is None else within.places)


def _require_vehicles(data: FlightEstimates) -> None:
    told = {name: len(set(data.member_of[data.known[:, i]])) for i, name in enumerate(data.names)}
    few = [f"{name} {count}" for name, count in told.items() if count < FEWEST]
    if few or not told:
        raise DataError(
            "a population needs several vehicles",
            found=f"vehicles that tell a parameter: {', '.join(few) or 'none'}",
            needed=f"at least {FEWEST} of each",
            action="leave the parameter out, or add logs of other vehicles",
        )


def _scales(data: FlightEstimates) -> tuple[Array, Array, Array]:
    """Centre of the estimates, their size, and the spread that vehicles show, each shape (p,)."""
    centre, scale, spread = (np.zeros(len(data.names)) for _ in range(3))
    variances = np.einsum("npp->np", data.covariances)
    for i in range(len(data.names)):
        there = data.known[:, i]
        values, member = data.values[there, i], data.member_of[there]
        counts = np.bincount(member, minlength=len(data.members))
        sums = np.bincount(member, values, minlength=len(data.members))
        means = sums[counts > 0] / counts[counts > 0]
        centre[i] = float(np.median(means))
        noise = float(np.median(variances[there, i]))
        spread[i] = np.sqrt(max(float(np.var(means, ddof=1)), 0.01 * noise))
        scale[i] = np.sqrt(noise + spread[i] ** 2)
    return centre, scale, spread


def _scaled(data: FlightEstimates, centre: Array, scale: Array) -> FlightEstimates:
    values = np.where(data.known, (data.values - centre) / scale, 0.0)
    return replace(data, values=values, covariances=data.covariances / np.outer(scale, scale))


def _searched(
    likelihood: RestrictedLikelihood,
    between: SpreadStructure,
    within: SpreadOfSome | None,
    start: Array,
) -> SpreadSearchEnd:
    split = between.size

    def spreads(numbers: Array) -> tuple[Array, Array | None]:
        there = None if within is None else within.matrix(numbers[split:])
        return between.matrix(numbers[:split]), there

    def cost(numbers: Array) -> tuple[float, Array]:
        at = likelihood.evaluate(*spreads(numbers))
        slope = between.gradient(numbers[:split], at.between_slope)
        if within is not None:
            slope = np.concatenate([slope, within.gradient(numbers[split:], at.within_slope)])
        return at.cost, slope

    first = between.start(start)
    if within is not None:
        first = np.concatenate([first, within.start(start)])
    found = minimize(
        cost, first, jac=True, method="L-BFGS-B", options={"ftol": 1e-13, "gtol": 1e-7,
                                                           "maxiter": 500},
    )  # fmt: skip
    ends = spreads(found.x)
    return SpreadSearchEnd(likelihood.evaluate(*ends), *ends, int(found.nfev))


def _trimmed(spread: Array) -> Array:
    """Variances too small to be told from none are none, with their covariances."""
    kept = np.diag(spread) > NEGLIGIBLE**2
    return np.where(np.outer(kept, kept), spread, 0.0)
