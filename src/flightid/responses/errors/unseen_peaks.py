"""Peaks of a pilot model between the bins of the records that it was fitted to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
NARROW = 0.5
"""Half width of a peak, in bins of a record, below which no bin need lie on it."""


def has_unseen_peak(
    omega_rad_s: Sequence[Real], numerators: Real, denominator: Real, scale_rad_s: float
) -> bool:
    """Whether a pole and zeros that all but cancel make a peak that bins of no record show.

    A light mode without a zero beside it may be as narrow: its tails are seen.

    Parameters
    ----------
    omega_rad_s : sequence of ndarray
        Bins of each record, from the first.
    numerators : ndarray, shape (n_in, order + 1)
    denominator : ndarray, shape (order + 1,)
        In powers of ``(ω0 − s)/(ω0 + s)``.
    scale_rad_s : float
        ω0.

    Example
    -------
    >>> bins = [np.arange(1, 100) * 0.1]
    >>> light = np.poly([np.exp(2j), np.exp(-2j)]).real[::-1]
    >>> near = np.poly([np.exp(2.02j), np.exp(-2.02j)]).real[::-1]
    >>> has_unseen_peak(bins, near[None], light, 1.0), has_unseen_peak(bins, near[None], near, 1.0)
    (True, True)
    >>> has_unseen_peak(bins, np.array([[1.0, 0.0, 0.0]]), light, 1.0)
    False
    """
    spacing = min(float(each[0]) for each in omega_rad_s)
    lowest = min(float(each[0]) for each in omega_rad_s)
    highest = max(float(each[-1]) for each in omega_rad_s)
    poles = _roots(denominator, scale_rad_s)
    inside = (poles.imag > lowest) & (poles.imag < highest)
    hidden = poles[inside & (np.abs(poles.real) < NARROW * spacing)]
    if not hidden.size:
        return False
    zeros = [_roots(each, scale_rad_s) for each in numerators]
    return any(
        all(bool(np.min(np.abs(each - pole), initial=np.inf) < spacing) for each in zeros)
        for pole in hidden
    )


def _roots(coefficients: Real, scale_rad_s: float) -> Complex:
    """In s, of a polynomial in ``(ω0 − s)/(ω0 + s)`` by rising powers."""
    found = np.roots(coefficients[::-1])
    return np.asarray(scale_rad_s * (1.0 - found) / (1.0 + found))
