"""How likely ends of a search are with the colour of their errors taken out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.evidence.gather import CONVERGED
from flightid.identification.innovation_tests import ROUNDING
from flightid.identification.output_error.innovation_gain import ORDER
from flightid.identification.output_error.sensor_noise import sensor_errors
from flightid.identification.prediction_error.part_blocks import errors_at
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.uncertainty.foretold import independent_samples

Array = NDArray[np.float64]
ALIKE = 0.05
"""Chance of twice the difference of two logarithms of likelihoods below which two minima differ."""
End = tuple[Array, float, Array, int, str]
"""Coefficients, sum of squares, triangular factor, iterations and ending of a search."""


def coloured_cost(
    structure: PolynomialStructure,
    data: SampledChannels,
    theta: Array,
    memory: list[list[float]],
    skip: int,
) -> tuple[float, int]:
    """Minus twice the log likelihood, but for a constant, and how many errors it is of.

    Output error leaves noise of any colour: its autoregression is taken out, and costs as in the
    Bayesian criterion.
    """
    errors = errors_at(structure, data, memory, theta)
    rows = [errors[None, span][:, skip:] for span in data.spans]
    if min(row.size for row in rows) > 3 * ORDER:
        left, lags = sensor_errors(rows)
    else:
        left, lags = np.concatenate(rows, axis=1), 0
    rounding = ROUNDING**2 * float(np.mean(data.output**2))
    power = max(float(np.mean(left**2)), rounding)
    return left.size * math.log(power) + lags * math.log(left.size), left.size


def likeliest(
    structure: PolynomialStructure,
    data: SampledChannels,
    minima: Sequence[list[End]],
    memory: list[list[float]],
    skip: int,
) -> tuple[list[list[End]], tuple[float, ...]]:
    """Minima of output error, the one first that chance does not refuse and that is likeliest.

    Slow noise holds few independent errors: between minima whose sums of squares differ no more
    than chance makes them, the colour of what each leaves decides. An end that is no minimum, as a
    search that stalls on the unit circle, comes after those that are.

    Parameters
    ----------
    minima : sequence of list
        Ends of each minimum, the smallest sum of squares first.

    Returns
    -------
    tuple of list and tuple of float
        The minima, and by how much twice the log likelihood of each lies below that of the first.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 7.4 (the likelihood of coloured noise).
    """
    least = minima[0][0][1]
    errors = errors_at(structure, data, memory, minima[0][0][0])
    samples = independent_samples([errors[span][skip:] for span in data.spans])
    limit = scipy.special.chdtri(1, ALIKE)
    costs = [coloured_cost(structure, data, each[0][0], memory, skip)[0] for each in minima]
    ranks = [
        (
            least > 0.0 and samples * math.log(each[0][1] / least) >= limit,
            each[0][-1] not in CONVERGED,
            cost,
            place,
        )
        for place, (each, cost) in enumerate(zip(minima, costs, strict=True))
    ]
    order = [rank[-1] for rank in sorted(ranks)]
    behind = tuple(costs[place] - costs[order[0]] for place in order)
    return [minima[place] for place in order], behind
