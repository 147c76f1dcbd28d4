"""Coefficients under a decaying prior whose shape is not known: draws over shapes and values."""

from __future__ import annotations

import math
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MEMORIES = np.geomspace(2.0, 40.0, 8)
"""Lags in which the prior's deviation falls to 1/e."""
ROUGHNESSES = np.geomspace(0.01, 0.6, 7)
"""One less the correlation of neighbours."""
SIZES = 18
SMALLEST, LARGEST = 1e-3, 1e2
"""What the prior adds to each row, in noise variances and in mean squares of the data."""


def kernel_draws(
    factor: Array,
    wanted: Array,
    variance: float,
    noise: Array,
    widening: float,
    random: np.random.Generator,
) -> tuple[Array, Array]:
    """Posterior mean, and draws, of coefficients whose prior is any of many decaying kernels.

    The best kernel alone would take its shape for known, which it is not where data are poor:
    every shape counts by its marginal likelihood.

    Parameters
    ----------
    factor : ndarray, shape (n, n)
        Triangle of the regressors.
    wanted : ndarray, shape (n,)
        What it times the coefficients should give.
    variance : float
        Of the noise.
    noise : ndarray, shape (count, n)
        Of each draw: what it adds to `wanted`.
    widening : float
        Scatter of draws over that of the posterior.
    random : Generator

    Returns
    -------
    tuple of ndarray
        Shapes (n,) and (count, n).

    Reference
    ---------
    Chen, Ohlsson & Ljung (2012), Automatica 48, eq. 35 (DC kernel); Rasmussen & Williams, *Gaussian
    Processes for Machine Learning*, section 5.2 (what a best kernel alone leaves out); Journel &
    Huijbregts (1978), *Mining Geostatistics*, section VII.A (draws of a posterior by kriging).
    """
    count, n = noise.shape
    roots = _roots(n)
    lowest = SMALLEST * variance
    powers = np.geomspace(lowest, max(LARGEST * float(wanted @ wanted) / n, 10.0 * lowest), SIZES)
    through = factor @ roots
    values, vectors = np.linalg.eigh(through @ through.transpose(0, 2, 1))
    values, turned = np.maximum(values, 0.0), np.einsum("kij,i->kj", vectors, wanted)
    middle = values.mean(axis=1)
    sizes = powers / np.where(middle > 0.0, middle, 1.0)[:, None]
    evidence = _evidence(values, turned**2, sizes, variance)
    weights = np.exp(-0.5 * (evidence - evidence.min()))
    weights /= weights.sum()
    chosen = random.multinomial(count, weights.ravel()).reshape(weights.shape)
    # In any order: two equations whose draws went from short to long memories would go together.
    order, used = random.permutation(count), 0
    mean, drawn = np.zeros(n), np.empty((count, n))
    for place, step in np.argwhere((weights >= 1e-4) | (chosen > 0)):
        root = math.sqrt(sizes[place, step]) * roots[place]
        damped = vectors[place] / (sizes[place, step] * values[place] + variance)
        gain = root @ (factor @ root).T @ damped @ vectors[place].T
        found = gain @ wanted
        mean += weights[place, step] * found
        # What the data leave of values of the prior, told with their noise: no root is taken.
        rows = order[used : used + chosen[place, step]]
        used += rows.size
        prior = random.standard_normal((rows.size, n)) @ root.T
        left = prior - (prior @ factor.T - noise[rows]) @ gain.T
        drawn[rows] = found + widening * left
    return mean, drawn


@cache
def _roots(count: int) -> Array:
    """Lower triangles of every shape of the prior, shape (shapes, count, count).

    Deviations that are largest at once and decay. Shapes that begin at zero, as what follows a
    delay does, lose the first hundredth of a step where sticks are slow: no data tell it there, and
    it was told to be late by more than its error. What correlates as powers of the distance is a
    chain, whose triangle is known.
    """
    lag = np.arange(1, count + 1)
    apart = np.maximum(lag[:, None] - lag, 0)
    made = []
    for memory, roughness in product(MEMORIES, ROUGHNESSES):
        deviation = np.exp(-lag / memory)
        chain = np.tril((1.0 - roughness) ** apart)
        chain[:, 1:] *= math.sqrt(1.0 - (1.0 - roughness) ** 2)
        made.append(deviation[:, None] * chain)
    return np.array(made)


def _evidence(values: Array, squares: Array, sizes: Array, variance: float) -> Array:
    """Minus twice the logarithm of the marginal likelihood at each size of each shape."""
    total = sizes[:, :, None] * values[:, None, :] + variance
    # Flat in the prior's variance: on a logarithmic grid no prior would favour none at all.
    fit = np.sum(squares[:, None, :] / total + np.log(total), axis=2)
    return np.asarray(fit - 2.0 * np.log(sizes))
