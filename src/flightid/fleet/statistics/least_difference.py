"""The least difference from its type that a vehicle would have shown: what "like it" could see."""

from __future__ import annotations

import numpy as np
from scipy.special import chndtrinc, fdtri

from flightid.fleet.statistics.heterogeneity import VehicleEstimates
from flightid.fleet.statistics.least_step import POWER
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE
from flightid.fleet.statistics.outliers import FAR_FROM_ZERO, FEWEST, REFITS
from flightid.fleet.statistics.population import Population
from flightid.uncertainty.estimate import Estimate

Differences = dict[str, tuple[Estimate, ...]]


def least_differences(population: Population) -> Differences:
    """Of each vehicle and parameter, the difference of which `POWER` are called unlike the type.

    The test of `find_outliers` turned round, for one vehicle that is unlike in one parameter, at
    the chance α = 5 % over all vehicles that the first alarm takes. Of a full spread Hotelling's
    limit and the non-central χ² that passes it; of another the distance at which the next vehicle
    is as rare as α over the parameters beside the others, at the errors of it and of their mean.

    Parameters
    ----------
    population : Population

    Returns
    -------
    dict of str to tuple of Estimate
        By vehicle, of the parameters that it tells: percent of the type's mean, or in the unit of
        the parameter where that may be zero. Infinite where too few vehicles tell it.

    Assumes
    -------
    That vehicle alone differs, and its other parameters lie as those of the type do.
    """
    data = population.data
    found: Differences = {}
    if len(data.members) < FEWEST:
        return {}
    shared = {} if len(data.members) <= REFITS else _of_all(population)
    for place, vehicle in enumerate(data.members):
        there = np.flatnonzero(population.own[place][2])
        found[vehicle] = tuple(
            _in_percent(population, int(i), _least(population, place, int(i), len(there), shared))
            for i in there
        )
    return found


def _least(
    population: Population, place: int, i: int, asked: int, shared: dict[int, float]
) -> float:
    """In the unit of the parameter."""
    spreads, members = population.spreads, len(population.data.members)
    chance = FALSE_SHARE / members
    own = float(population.own[place][1][i, i])
    if spreads.structure == "full":
        total = spreads.between[i, i] + spreads.mean_covariance[i, i] + own
        return float(np.sqrt(total * _hotelling(asked, members - 2, chance)))
    there = [n for n, each in enumerate(population.own) if each[2][i]]
    if len(there) < FEWEST:
        return np.inf
    reach = shared.get(i)
    if reach is None:
        others = _estimates(population, [n for n in there if n != place], i)
        reach = others.next_reach(own, chance / asked, POWER)
    return reach


def _hotelling(q: int, freedom: int, chance: float) -> float:
    """Squared distance that passes Hotelling's limit in `POWER` of draws; infinite of few."""
    left = freedom - q + 1.0
    if left <= 0.0:
        return np.inf
    limit = float(fdtri(q, left, 1.0 - chance)) * freedom * q / left
    return float(chndtrinc(limit, q, 1.0 - POWER))


def _of_all(population: Population) -> dict[int, float]:
    """Of many vehicles, of which one moves the spread little: by parameter, at a typical error."""
    p, members = len(population.names), len(population.data.members)
    found: dict[int, float] = {}
    for i in range(p):
        there = [n for n, each in enumerate(population.own) if each[2][i]]
        if population.spreads.structure != "full" and len(there) >= FEWEST:
            every = _estimates(population, there, i)
            typical = float(np.median(every.variances))
            found[i] = every.next_reach(typical, FALSE_SHARE / (members * p), POWER)
    return found


def _estimates(population: Population, places: list[int], i: int) -> VehicleEstimates:
    own = [population.own[n] for n in places]
    values = np.array([each[0][i] for each in own])
    return VehicleEstimates(values, np.array([each[1][i, i] for each in own]))


def _in_percent(population: Population, i: int, size: float) -> Estimate:
    data, spreads = population.data, population.spreads
    base, error = float(spreads.mean[i]), float(np.sqrt(spreads.mean_covariance[i, i]))
    far = abs(base) > FAR_FROM_ZERO * error
    value = 100.0 * size / abs(base) if far else size
    return Estimate(data.names[i], value, "%" if far else data.units[i])
