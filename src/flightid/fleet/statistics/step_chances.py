"""The exact chance of a largest step.

The standardised step at every place where it may stand is a Gaussian Markov chain where errors are
independent, so the chance that the largest of them exceeds a limit is a chain of one-dimensional
integrals: no simulation, and exact in the tail where thousands of series are corrected for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from flightid.uncertainty.quadrature import gauss_legendre

Array = NDArray[np.float64]
NODES = 24
"""Least number of nodes of each integral."""
NODES_A_STEP = 5.0
"""Nodes over the width that the chain moves by in one step."""
NODES_APART = 8
"""Numbers of nodes that are kept lie as far apart: they take as long to find as the integrals."""
MOST_NODES = 400
FAR = 8.0
"""Standard errors from which chances, some 1e-13, are bounded instead of computed."""


def largest_step_chance(statistic: float, correlations: Array) -> float:
    """Chance that the square of the largest standardised step is above a number were there none.

    Parameters
    ----------
    statistic : float
    correlations : ndarray, shape (m − 1,)
        Between neighbours of the m standardised steps.

    Returns
    -------
    float
        From 0 to 1, to a relative 1e-6 for independent errors. An approximation where they hang
        together, as by the error of a covariate: then neighbours alone are accounted for.

    Example
    -------
    >>> round(largest_step_chance(3.841458820694, np.zeros(0)), 6)
    0.05
    """
    limit = float(np.sqrt(max(statistic, 0.0)))
    if limit == 0.0:
        return 1.0
    if limit > FAR:  # Bonferroni: what it adds to itself is of no account there
        return float(min(1.0, 2.0 * (len(correlations) + 1) * ndtr(-limit)))
    moves = np.sqrt(np.maximum(1.0 - correlations**2, 1e-12))
    least = float(moves.min(initial=1.0))
    count = int(min(max(NODES, NODES_A_STEP * limit / least), MOST_NODES))
    nodes, weights = gauss_legendre(count + -count % NODES_APART)
    nodes, weights = 0.5 * limit * (nodes + 1.0), 0.5 * limit * weights
    # Of the absolute value: what goes to −x comes from x as what goes to x comes from −x.
    density = 2.0 * _normal(nodes)
    outside = 2.0 * float(ndtr(-limit))
    for correlation, move in zip(correlations, moves, strict=True):
        mass = weights * density
        leaving = ndtr((correlation * nodes - limit) / move)
        leaving += ndtr((-correlation * nodes - limit) / move)
        outside += float(mass @ leaving)
        shifted = correlation * nodes
        kernel = _normal((nodes[:, None] - shifted) / move)
        kernel += _normal((nodes[:, None] + shifted) / move)
        density = kernel @ mass / move
    return float(min(outside, 1.0))


def _normal(x: Array) -> Array:
    return np.asarray(np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi))
