"""Standard errors that few degrees of freedom tell, each beside those of all flights of a type."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import digamma, polygamma

from flightid.uncertainty.quantiles import LEVEL, half_width

Array = NDArray[np.float64]
FEWEST = 8
"""Flights that tell an error by few degrees of freedom, below which each counts by itself."""
MOST = 1e6
"""Degrees of freedom above which errors of a type are all alike."""


def moderated_errors(stderr: Array, freedom: Array) -> Array:
    """Standard errors of one parameter, as normal ones that make 95 % intervals as long.

    A fit states s² with d degrees of freedom: some are half as large by chance, and weigh twice as
    much. Flights of a type tell how far the true ones differ, as 1 / σ² ~ χ²(d₀) / (d₀ s₀²):

        s̃² = (d₀ s₀² + d s²) / (d₀ + d),   with d₀ + d degrees of freedom

    d₀ and s₀ by the mean and variance of log s²; errors that scatter no further than their d says
    are one: d₀ is infinite.

    Parameters
    ----------
    stderr : ndarray, shape (n,)
    freedom : ndarray, shape (n,)
        Infinite where an error is known.

    Returns
    -------
    ndarray, shape (n,)
        As stated where freedom is infinite.

    Assumes
    -------
    Flights of like length: where they differ true errors do, and each counts for more by itself.

    Reference
    ---------
    Smyth, *Stat. Appl. Genet. Mol. Biol.* 3 (2004), article 3, section 6.2 (d₀ and s₀).

    Example
    -------
    >>> errors = np.sqrt(np.random.default_rng(1).chisquare(8, 60) / 8)
    >>> made = moderated_errors(errors, np.full(60, 8.0))
    >>> [round(float(each.std() / each.mean()), 2) for each in (errors, made)]
    [0.22, 0.0]
    """
    made, few = stderr.copy(), np.isfinite(freedom)
    s2, d = stderr[few] ** 2, freedom[few]
    of_type, typical = _prior(s2, d) if np.count_nonzero(few) >= FEWEST else (0.0, 0.0)
    if np.isinf(of_type):
        made[few] = np.sqrt(typical)
        return made
    wide = [half_width(LEVEL, each) / half_width(LEVEL) for each in of_type + d]
    made[few] = np.sqrt((of_type * typical + d * s2) / (of_type + d)) * wide
    return made


def _prior(s2: Array, d: Array) -> tuple[float, float]:
    """Degrees of freedom and variance that a type's flights have in common."""
    half = 0.5 * d
    logs = np.log(s2) - digamma(half) + np.log(half)
    beyond = float(np.var(logs, ddof=1) - np.mean(polygamma(1, half)))
    if beyond <= float(polygamma(1, 0.5 * MOST)):
        return np.inf, float(np.exp(logs.mean()))
    log_half = brentq(lambda x: float(polygamma(1, np.exp(x))) - beyond, -9.0, np.log(MOST))
    shared = float(np.exp(log_half))
    return 2.0 * shared, float(np.exp(logs.mean() + digamma(shared) - np.log(shared)))
