"""How well a noise spectrum is known: the groups of bins that its levels are means of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Real = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseLevels:
    """Levels of a noise, each estimated by itself; in between its logarithm runs straight.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n,)
        Ascending.
    freedom : ndarray, shape (n,)
        Degrees of freedom of each: a level is χ² of as many, over their number.
    """

    omega_rad_s: Real
    freedom: Real

    def shares(self, omega_rad_s: Real) -> Real:
        """How the logarithm of the density answers to that of each level, shape (n, n_omega).

        Example
        -------
        >>> NoiseLevels(np.array([1.0, 3.0]), np.ones(2)).shares(np.array([0.5, 1.5, 4.0])).T
        array([[1.  , 0.  ],
               [0.75, 0.25],
               [0.  , 1.  ]])
        """
        count = len(self.omega_rad_s)
        place = np.interp(omega_rad_s, self.omega_rad_s, np.arange(float(count)))
        return np.asarray(np.maximum(1.0 - np.abs(place - np.arange(count)[:, None]), 0.0))


class LevelVariances(NamedTuple):
    """What each level of a noise adds to some variances.

    Attributes
    ----------
    variances : ndarray, shape (n_levels, n)
    freedom : ndarray, shape (n_levels,)
    """

    variances: Real
    freedom: Real


class LevelProducts(NamedTuple):
    """What each level of a noise adds to a covariance, times a gain.

    Attributes
    ----------
    products : ndarray, shape (n_levels, n_points, n_rows)
        ``V_g Gᵀ``: V_g the covariance's derivative by the logarithm of level g.
    freedom : ndarray, shape (n_levels,)
    """

    products: Real
    freedom: Real
