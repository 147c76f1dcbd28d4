"""Process noise that a record does not show: none is the likeliest, and some may be there.

A density has a bound, zero, at which the likelihood of many records that hold little noise ends. It
is no free direction there, and slopes at the bound tell too little: the likelihood falls ever more
slowly as noise grows. What a record leaves of it is read off the likelihood itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightid.identification.filter_error.innovations import InnovationsProblem
from flightid.identification.multistart import DenseEnd

Array = NDArray[np.float64]
LOGS = np.linspace(-4.0, 0.0, 17)
"""Logarithms of a deviation over its scale that are tried: up to a tenth of the motion."""
POWER = 1.0
"""Of the deviation, before the search all of one size: 1 where it, 2 where its square is."""


class UnseenNoise(NamedTuple):
    """A density that came out as none.

    Attributes
    ----------
    place : int
        Of its logarithm among all unknowns.
    mean, deviation : float
        Of the density that may be there all the same, over the square of its scale.
    """

    place: int
    mean: float
    deviation: float


def unseen_noises(problem: InnovationsProblem, end: DenseEnd) -> list[UnseenNoise]:
    """Process noises at their bound of zero, and how much of each a record leaves possible.

    Parameters
    ----------
    problem : InnovationsProblem
    end : DenseEnd
        Of the search.

    Assumes
    -------
    Any deviation as likely as another before the record; of several such noises the others none;
    parameters at the end of the search.

    Reference
    ---------
    Self & Liang (1987), J. American Statistical Association 82 (variances at their bound); Gelman
    (2006), Bayesian Analysis 1(3), section 3 (a flat prior of deviations).
    """
    first, found = problem.n_free, []
    for place in range(first, first + len(problem.noisy)):
        if end.x[place] > -problem.reach[place - first] + 1e-6:
            continue
        weight = np.array([_chance(problem, end, place, log) for log in LOGS])
        weight *= np.exp(POWER * LOGS)
        if weight.sum() > 0.0:
            square = np.exp(2.0 * LOGS)
            mean = float(weight @ square / weight.sum())
            spread = float(weight @ (square - mean) ** 2 / weight.sum())
            found.append(UnseenNoise(place, mean, math.sqrt(spread)))
    return found


def _chance(problem: InnovationsProblem, end: DenseEnd, place: int, log: float) -> float:
    """Likelihood with so much noise over that without; 0 where there is no filter."""
    x = end.x.copy()
    x[place] = log
    residuals, _ = problem.residuals(x, with_slopes=False)
    cost = float(residuals @ residuals)
    if not math.isfinite(cost):
        return 0.0
    return math.exp(min(-0.5 * problem.n_measured * math.log(cost / end.cost), 0.0))
