"""Coherence without what chance makes of it, to choose and weigh points that know their own error.

Noise that raises a gain by chance raises the coherence beside it, and by way of a loop noise that
turns a phase does too. Points that are chosen and weighed by their own measured coherence are those
whose errors lie to one side, and a fit leans, however many points it has: of sweeps in heavy gusts,
five independent windows, by half a standard error.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
HALF_WIDTH = 0.5
"""Octaves to each side over which the median is taken: several windows' resolutions."""
SURE = 3.0
"""Standard deviations of chance from which on a point differs from its neighbours."""
LEAST, MOST = 1e-6, 1.0 - 1e-12


def steady_coherence(omega_rad_s: Array, coherence: Array, random_error: Array) -> Array:
    """Median coherence γ² of the neighbours, where chance explains that a point differs from it.

    Log-odds of γ² by n windows scatter by √(2/(n γ²)). Points that lie further off, as in a notch,
    stand as they are; the end of a sweep stays where it is, for it is the median's end too.

    Parameters
    ----------
    omega_rad_s : ndarray, shape (n,)
        Frequencies, rad/s, ascending.
    coherence : ndarray, shape (n,)
        γ², 0 to 1.
    random_error : ndarray, shape (n,)
        Of the gain, 1 σ, relative; zero where nothing is known of chance.

    Returns
    -------
    ndarray, shape (n,)

    Reference
    ---------
    Bendat & Piersol, *Engineering Applications of Correlation and Spectral Analysis*, 2nd ed.,
    table 11.3: random error of a coherence.

    Example
    -------
    >>> omega = np.array([1.0, 1.1, 1.2, 1.3, 1.4])
    >>> uneven = np.array([0.7, 0.8, 0.75, 0.02, 0.8])
    >>> steady_coherence(omega, uneven, np.full(5, 0.2)).round(2)
    array([0.75, 0.75, 0.75, 0.02, 0.75])
    >>> steady_coherence(omega, uneven, np.full(5, 0.001)).round(2)
    array([0.7 , 0.8 , 0.75, 0.02, 0.8 ])
    """
    octaves = np.log2(omega_rad_s)
    known = np.clip(coherence, LEAST, MOST)
    odds = np.log(known / (1.0 - known))
    first = np.searchsorted(octaves, octaves - HALF_WIDTH)
    last = np.searchsorted(octaves, octaves + HALF_WIDTH, side="right")
    middle = np.array([np.median(odds[a:b]) for a, b in zip(first, last, strict=True)])
    share = 1.0 / (1.0 + np.exp(-middle))
    # 2/n of each point, by the error that n windows give a gain of its coherence.
    chance = 4.0 * random_error**2 * known / (1.0 - known) / share
    return np.where((odds - middle) ** 2 < SURE**2 * chance, share, coherence)
