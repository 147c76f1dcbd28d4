"""Flights beside their neighbours in time: odd ones count for less."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.flight_estimates import FlightEstimates

Array = NDArray[np.float64]
ODD = 3.0
"""Standard errors off the flights before and those after, on the same side."""
BESIDE = 3
"""Flights on either side that an odd one is held against."""


def variances_with_odd_ones(
    data: FlightEstimates, i: int, variances: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Variances of one parameter by flight, larger where a flight lies off those beside it.

    Parameters
    ----------
    data : FlightEstimates
        What covariates explain taken out.
    i : int
        Place of the parameter.
    variances : ndarray, shape (n,)
        Of the flights, as they are taken for.

    Returns
    -------
    variances : ndarray, shape (n,)
    odd : ndarray of bool, shape (n,)
        Flights more than 3 standard errors off the median of the three before *and* that of the
        three after, on the same side: a step agrees with one of them. The first and the newest have
        one side alone: there the three beside them and the nearest of these count, so that of two
        new flights at another level neither is odd. Their distance counts as their error.
    """
    made, odd = variances.copy(), np.zeros(len(variances), dtype=bool)
    for rows in histories_in_time(data, i):
        values, own = data.values[rows, i], variances[rows]
        usual, in_time = float(np.median(own)), values.tolist()
        for place, row in enumerate(rows):
            off = [in_time[place] - level for level in _levels_beside(in_time, place)]
            nearest = min(off, key=abs, default=0.0)
            if any(nearest * each < 0.0 for each in off):
                continue
            if abs(nearest) > ODD * np.sqrt(own[place] + usual / 2.0):
                made[row], odd[row] = own[place] + nearest**2, True
    return made, odd


def _levels_beside(values: Sequence[float], place: int) -> list[float]:
    """Levels before and after a flight; at an end those of the three beside it and the nearest."""
    before, after = values[max(0, place - BESIDE) : place], values[place + 1 : place + 1 + BESIDE]
    if len(before) and len(after):
        return [median(before), median(after)]
    if len(before):
        return [median(before), before[-1]]
    return [median(after), after[0]] if len(after) else []


def histories_in_time(data: FlightEstimates, i: int) -> Iterator[NDArray[np.intp]]:
    """Flights of each vehicle that tell the parameter, in time."""
    for member in range(len(data.members)):
        rows = np.flatnonzero((data.member_of == member) & data.known[:, i])
        if len(rows):
            yield rows[np.argsort(data.time_s[rows], kind="stable")]
