"""Vehicles whose own flights scatter further than their errors say, while the fleet's do not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from flightid.fleet.statistics.flight_estimates import Flags, FlightEstimates
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE, corrected
from flightid.fleet.statistics.neighbours import histories_in_time
from flightid.frozen import dataclass

Array = NDArray[np.float64]
FEWEST_STEPS = 5
"""From flight to flight of one vehicle, below which their scatter says nothing of it."""
FEWEST_VEHICLES = 3
"""Below which a fleet has no scatter beside that of one vehicle."""
LARGEST = 0.1
"""Share of steps that do not count, the largest: a change is one of them, an odd flight two."""
COUNTED = 0.05
"""Chance of a scatter as large, below which it counts for the vehicle."""
DRAWS = 2000


@dataclass(frozen=True)
class VehicleScale:
    """How far flights of one vehicle scatter in a parameter, in errors as the fleet takes them.

    Attributes
    ----------
    vehicle, name : str
    factor : float
        Of standard errors, above 1: its errors count as many times as large.
    chance : float
        Of a scatter as large were they as the fleet's.
    false_share : float
        Benjamini–Hochberg over all vehicles and parameters.
    """

    vehicle: str
    name: str
    factor: float
    chance: float
    false_share: float = 1.0

    @property
    def is_sure(self) -> bool:
        """Whether it is said, false ones among all vehicles accounted for."""
        return self.false_share <= FALSE_SHARE

    @property
    def counts(self) -> bool:
        """Whether errors of this vehicle count as its flights scatter: caution asks for less."""
        return self.chance <= COUNTED

    def words(self, labels: Mapping[str, str]) -> str:
        """What was found, and what was done."""
        name = labels.get(self.name, self.name)
        return (
            f"{self.vehicle}: {name} scatters {self.factor:.2g} times as far from flight to flight "
            "as its errors say and other vehicles do; so they count"
        )


def own_scales(data: FlightEstimates, i: int, variances: Array, odd: Flags) -> list[VehicleScale]:
    """Hold the steps from flight to flight of each vehicle beside errors that hold for the fleet.

        r = √ mean Δ² / (v₁ + v₂) without the largest tenth of the steps,   factor = r / m

    m is the median r of normal draws of as many flights.

    Parameters
    ----------
    data : FlightEstimates
        What covariates and events explain, and what all vehicles share, taken out.
    i : int
        Place of the parameter.
    variances : ndarray, shape (n,)
        What stated ones are taken for over the fleet.
    odd : ndarray of bool, shape (n,)
        Flights far off those beside them, which do not count.

    Returns
    -------
    list of VehicleScale
        Of every vehicle with six flights or more; not yet corrected: `judged_scales`. None in a
        fleet of fewer than three.

    Assumes
    -------
    Changes from one flight to the next small beside errors, but of a tenth of the steps. The
    logarithm of r is normal, with the mean and spread that draws of as many flights have.
    """
    if len(data.members) < FEWEST_VEHICLES:
        return []
    found = []
    for every in histories_in_time(data, i):
        rows = every[~odd[every]]
        steps = len(rows) - 1
        if steps < FEWEST_STEPS:
            continue
        own = variances[rows]
        sizes = np.abs(np.diff(data.values[rows, i])) / np.sqrt(own[1:] + own[:-1])
        scatter = float(_scatter(sizes[None])[0])
        centre, spread = _usual(steps)
        # Flights that are all equal scatter less than any.
        beyond = (np.log(scatter) - centre) / spread if scatter > 0.0 else -np.inf
        factor = scatter / float(np.exp(centre))
        vehicle = data.vehicles[int(rows[0])]
        found.append(VehicleScale(vehicle, data.names[i], factor, float(ndtr(-beyond))))
    return found


def _scatter(sizes: Array) -> Array:
    """Root mean square of steps in each row, shape (m, steps), without the largest ones."""
    kept = sizes.shape[1] - int(np.ceil(LARGEST * sizes.shape[1]))
    return np.asarray(np.sqrt(np.mean(np.sort(sizes, axis=1)[:, :kept] ** 2, axis=1)))


@cache
def _usual(steps: int) -> tuple[float, float]:
    """Mean and standard deviation of the logarithm of the scatter of flights with equal errors."""
    draws = np.random.default_rng(steps).normal(size=(DRAWS, steps + 1))
    logs = np.log(_scatter(np.abs(np.diff(draws, axis=1)) / np.sqrt(2.0)))
    return float(logs.mean()), float(logs.std())


def variance_factors(scales: Sequence[VehicleScale], vehicles: Sequence[str]) -> Array:
    """What variances of each flight are multiplied by, shape (n,)."""
    own = {each.vehicle: max(each.factor, 1.0) ** 2 for each in scales if each.counts}
    return np.array([own.get(vehicle, 1.0) for vehicle in vehicles])


def judged_scales(scales: Sequence[VehicleScale]) -> tuple[VehicleScale, ...]:
    """Every vehicle that counts by its own flights, with its share of false ones among all."""
    shares = corrected([each.chance for each in scales])
    judged = (replace(e, false_share=float(s)) for e, s in zip(scales, shares, strict=True))
    return tuple(each for each in judged if each.counts)
