"""Coefficients under a decaying prior whose shape is not known: draws over shapes and values."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MEMORIES = np.geomspace(2.0, 40.0, 8)
"""Lags after which the prior's deviation is largest."""
ROUGHNESSES = np.geomspace(0.01, 0.6, 7)
"""One less the correlation of neighbours."""
WIDENING = 1.25
"""Scatter of draws over that of the posterior, whose prior is centred on no response: counted by
`tests/strangers/ordinary_steps.py`."""
SIZES = 18
SMALLEST, LARGEST = 1e-3, 1e2
"""What the prior adds to each row, in noise variances and in mean squares of the data."""


def kernel_draws(
    factor: Array, wanted: Array, variance: float, count: int, random: np.random.Generator
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
    count : int
        Draws.
    random : Generator

    Returns
    -------
    tuple of ndarray
        Shapes (n,) and (count, n).

    Reference
    ---------
    Chen, Ohlsson & Ljung (2012), Automatica 48, eq. 35 (DC kernel); Rasmussen & Williams, *Gaussian
    Processes for Machine Learning*, section 5.2 (what a best kernel alone leaves out).
    """
    n = wanted.size
    shapes = list(_shapes(n))
    lowest = SMALLEST * variance
    powers = np.geomspace(lowest, max(LARGEST * float(wanted @ wanted) / n, 10.0 * lowest), SIZES)
    parts = [np.linalg.eigh(factor @ shape @ factor.T) for shape in shapes]
    scaled = [powers / (values.mean() or 1.0) for values, _ in parts]
    evidence = np.array(
        [
            _evidence(values, (vectors.T @ wanted) ** 2, sizes, variance)
            for (values, vectors), sizes in zip(parts, scaled, strict=True)
        ]
    )
    weights = np.exp(-0.5 * (evidence - evidence.min()))
    weights /= weights.sum()
    chosen = random.multinomial(count, weights.ravel()).reshape(weights.shape)
    mean, drawn = np.zeros(n), []
    for place, step in product(range(len(shapes)), range(SIZES)):
        if weights[place, step] < 1e-4 and not chosen[place, step]:
            continue
        values, vectors = parts[place]
        prior = scaled[place][step] * shapes[place]
        gain = prior @ factor.T @ vectors
        damped = gain / (scaled[place][step] * np.maximum(values, 0.0) + variance)
        middle = damped @ (vectors.T @ wanted)
        mean += weights[place, step] * middle
        if chosen[place, step]:
            covariance = prior - damped @ gain.T
            spread, directions = np.linalg.eigh(covariance)
            root = directions * np.sqrt(np.maximum(spread, 0.0))
            numbers = WIDENING * random.standard_normal((chosen[place, step], n))
            drawn.append(middle + numbers @ root.T)
    return mean, np.vstack(drawn)


def _shapes(count: int) -> Iterator[Array]:
    """Bumps that begin at zero, as what follows a delay and a motor's lag does."""
    lag = np.arange(1, count + 1)
    apart = np.abs(lag[:, None] - lag)
    for memory, roughness in product(MEMORIES, ROUGHNESSES):
        bump = lag / memory * np.exp(1.0 - lag / memory)
        yield np.outer(bump, bump) * (1.0 - roughness) ** apart


def _evidence(values: Array, squares: Array, sizes: Array, variance: float) -> Array:
    """Minus twice the logarithm of the marginal likelihood at each size of one shape."""
    total = sizes[:, None] * np.maximum(values, 0.0) + variance
    # Flat in the prior's variance: on a logarithmic grid no prior would favour none at all.
    return np.asarray(np.sum(squares / total + np.log(total), axis=1) - 2.0 * np.log(sizes))
