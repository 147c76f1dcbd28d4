"""Score test for a gust: what −2 ln p would gain, without a search.

Density of a gust that is not there is a variance at its bound, zero, where the likelihood still has
a slope by it. Slopes by all other unknowns are taken out of that one, so that noise and derivatives
which could do the same are not counted.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.filter_error.gusts import GUST_REACH
from flightid.identification.filter_error.innovations import InnovationsProblem
from flightid.identification.multistart import DenseEnd

Array = NDArray[np.float64]
TIMES = (1.0, 4.0)
"""Of a gust over its first guess: a longer one is told worse by what a short one would show."""
STEP = 3.0
"""Most that a logarithm of a noise moves in the test's own step."""
LARGEST = 3.0
"""Deviation of a gust over its state's first guess at which its search begins at most."""


@dataclass(frozen=True)
class Score:
    """A candidate at the end of the search without it.

    Attributes
    ----------
    problem : InnovationsProblem
        With the gust; its time is the first guess.
    gain : float
        Fall of −2 ln p that the slopes foretell, negative where the density would have to be.
    start : ndarray, shape (n_all,)
        Where the step of the test leads, noises within `STEP`.
    """

    problem: InnovationsProblem
    gain: float
    start: Array


def score(problem: InnovationsProblem, end: DenseEnd) -> Score:
    """Test the gust of a problem at the end of the search without one.

    Parameters
    ----------
    problem : InnovationsProblem
        With the gust.
    end : DenseEnd
        Of the problem without it.

    Reference
    ---------
    Rao (1948), Proc. Cambridge Philosophical Society 44; Self & Liang (1987), J. American
    Statistical Association 82 (variances at their bound).
    """
    assert problem.gust is not None
    found = [_at(problem, end, time) for time in TIMES]
    (_, density, step), gain = found[0], max(each[0] for each in found)
    moved = end.x + step
    noises = slice(problem.n_free, len(end.x))
    moved[noises] = np.clip(step[noises], -STEP, STEP) + end.x[noises]
    deviation = 0.5 * math.log(min(max(density, math.exp(-2.0 * STEP)), LARGEST**2))
    return Score(problem, gain, np.concatenate([moved, [deviation, 0.0]]))


def _at(problem: InnovationsProblem, end: DenseEnd, time: float) -> tuple[float, float, Array]:
    """Gain, squared deviation over its scale and the step of all others, for one time."""
    assert problem.gust is not None
    gust = replace(problem.gust, time_scale_s=time * problem.gust.time_scale_s)
    # A gust of e⁻⁶ of its scale adds nothing yet; the slope by its squared deviation is exact.
    at = replace(problem, gust=gust)
    residuals, slopes = at.residuals(np.append(end.x, [-GUST_REACH, 0.0]), with_slopes=True)
    if not np.all(np.isfinite(slopes)):
        return -np.inf, 0.0, np.zeros_like(end.x)
    by_square = slopes[:, -2] / (2.0 * math.exp(-2.0 * GUST_REACH))
    others = slopes[:, :-2]
    size = np.linalg.norm(others, axis=0)
    size[size == 0.0] = 1.0
    both = np.column_stack([by_square, residuals])
    share = np.linalg.lstsq(others / size, both, rcond=1e-10)[0] / size[:, None]
    alone, left = (both - others @ share).T
    information = float(alone @ alone)
    if information <= 0.0:
        return -np.inf, 0.0, np.zeros_like(end.x)
    slope = -float(alone @ left)
    density = slope / information
    gain = problem.n_measured * slope * abs(density) / float(residuals @ residuals)
    return gain, density, -(share[:, 1] + density * share[:, 0])
