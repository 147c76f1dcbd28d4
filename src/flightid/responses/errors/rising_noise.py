"""Noise that rises towards zero frequency, as drift does: means over its first bins hide that."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
TINY = float(np.finfo(float).tiny)


def sure_slope(omega_rad_s: Real, power: Real) -> Real:
    """Power of frequency by which a noise spectrum rises towards zero for sure; 0 where not.

    The slope of log periodograms over log frequency, less one standard error of it.

    Parameters
    ----------
    omega_rad_s : ndarray, shape (n_bins,)
        rad/s, positive.
    power : ndarray, shape (..., n_bins)
        Squared size of the noise's bins.

    Returns
    -------
    ndarray, shape (...)
        Zero or negative.

    Reference
    ---------
    Geweke & Porter-Hudak, *J. Time Series Analysis* 4 (1983), 221–238, section 4: regression of log
    periodograms, whose errors have variance π²/6.

    Example
    -------
    >>> omega = np.arange(1.0, 101.0)
    >>> float(sure_slope(omega, omega**-2).round(2)), float(sure_slope(omega, omega**0))
    (-1.86, 0.0)
    """
    away = np.log(omega_rad_s) - np.log(omega_rad_s).mean()
    spread = float(away @ away)
    if spread <= 0.0:
        return np.zeros(np.shape(power)[:-1])
    slope = np.log(np.maximum(power, TINY)) @ away / spread
    return np.asarray(np.minimum(slope + np.pi / np.sqrt(6.0 * spread), 0.0))


def octaves(omega_rad_s: Real) -> list[Real]:
    """Neighbouring bins by octaves, the first ones together as those below two of them.

    Example
    -------
    >>> [part.tolist() for part in octaves(np.arange(1.0, 10.0))]
    [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0, 7.0], [8.0, 9.0]]
    """
    number = np.floor(np.log2(omega_rad_s / omega_rad_s[0] * (1.0 + 1e-9))).astype(np.intp)
    number = np.maximum(number, 1)
    return [omega_rad_s[number == each] for each in np.unique(number)]
