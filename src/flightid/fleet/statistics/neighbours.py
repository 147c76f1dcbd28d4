"""Flights beside their neighbours in time: whether errors hold without repeats, and odd ones."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.flight_estimates import FlightEstimates

Array = NDArray[np.float64]
FEWEST_STEPS = 20
"""From flight to flight, below which their scatter says nothing."""
NORMAL_MEDIAN = 0.6744897501960817
"""Of the size of a standard normal number."""
ODD = 3.0
"""Standard errors off the flights before and those after, on the same side."""
BESIDE = 3
"""Flights on either side that an odd one is held against."""


def neighbour_factor(data: FlightEstimates, i: int) -> float:
    """What variances of one parameter are multiplied by, from flight to flight; 1 at least.

    The median size of standardised steps between neighbouring flights of a vehicle, over the fleet:
    a step or a slow drift moves few of them, an odd flight two.

    Parameters
    ----------
    data : FlightEstimates
        What covariates explain taken out.
    i : int
        Place of the parameter.

    Returns
    -------
    float
        1 too with fewer than 20 such steps.

    Assumes
    -------
    Changes from one flight to the next small beside errors; where every flight differs (payload
    that no covariate tells) that counts as error, and real changes are found later.
    """
    steps = [
        np.diff(data.values[rows, i])
        / np.sqrt(data.covariances[rows[1:], i, i] + data.covariances[rows[:-1], i, i])
        for rows in _histories(data, i)
    ]
    sizes = np.abs(np.concatenate(steps)) if steps else np.zeros(0)
    if len(sizes) < FEWEST_STEPS:
        return 1.0
    return max(1.0, float(np.median(sizes) / NORMAL_MEDIAN) ** 2)


def variances_with_odd_ones(data: FlightEstimates, i: int, factor: float) -> tuple[Array, Array]:
    """Variances of one parameter by flight, larger where a flight lies off those beside it.

    Parameters
    ----------
    data : FlightEstimates
        What covariates explain taken out.
    i : int
        Place of the parameter.
    factor : float
        Of all variances.

    Returns
    -------
    variances : ndarray, shape (n,)
        1 where the parameter is not known.
    odd : ndarray of bool, shape (n,)
        Flights more than 3 standard errors off the median of the three before *and* that of the
        three after, on the same side: a step agrees with one of them. Their distance counts as
        their error.
    """
    variances = factor * np.where(data.known[:, i], data.covariances[:, i, i], 1.0 / factor)
    odd = np.zeros(len(variances), dtype=bool)
    for rows in _histories(data, i):
        values, own = data.values[rows, i], variances[rows]
        for place, row in enumerate(rows):
            sides = (slice(max(0, place - BESIDE), place), slice(place + 1, place + 1 + BESIDE))
            off = [values[place] - np.median(values[side]) for side in sides if len(values[side])]
            nearest = min(off, key=abs, default=0.0)
            if any(nearest * each < 0.0 for each in off):
                continue
            if abs(nearest) > ODD * np.sqrt(own[place] + np.median(own) / 2.0):
                variances[row], odd[row] = own[place] + nearest**2, True
    return variances, odd


def _histories(data: FlightEstimates, i: int) -> Iterator[NDArray[np.intp]]:
    """Flights of each vehicle that tell the parameter, in time."""
    for member in range(len(data.members)):
        rows = np.flatnonzero((data.member_of == member) & data.known[:, i])
        if len(rows):
            yield rows[np.argsort(data.time_s[rows], kind="stable")]
