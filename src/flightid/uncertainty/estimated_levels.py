"""What noise levels that are estimates themselves leave in doubt about estimates by least squares.

Weights from an estimated noise follow its accidents: estimates scatter more than true weights let
them, and the covariance that those weights promise is too small, by as much again. How far that
covariance itself may be off tells Student's degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EstimatedLevels:
    """Independent levels of the noise of some data, as the scores of a fit hear them.

    Attributes
    ----------
    heard : ndarray, shape (n_levels, n, n)
        ``G V_g Gᵀ``: what each level adds to the covariance of the scores ``G e`` of errors e, V_g
        the derivative of their covariance V by the level's logarithm.
    weighed : ndarray, shape (n_levels, n, n)
        ``G V_g V⁻¹ V_g Gᵀ``: V⁻¹ weighs the data.
    freedom : ndarray, shape (n_levels,)
        Degrees of freedom of each level.

    Reference
    ---------
    Kenward & Roger (1997), Small sample inference for fixed effects from restricted maximum
    likelihood, Biometrics 53(3), section 2; Satterthwaite (1946), Biometrics Bulletin 2(6), eq. 17.

    Example
    -------
    Two means of one number, with variances 1 and 1 that are known to 10 degrees of freedom each:

    >>> heard = np.array([[[1.0]], [[1.0]]])
    >>> levels = EstimatedLevels(heard, heard, np.array([10.0, 10.0]))
    >>> solve = np.array([[0.5]])
    >>> (solve @ levels.added(solve) @ solve).item(), (0.25 / levels.doubt(solve)).round(9).item()
    (0.1, 20.0)
    """

    heard: Array
    weighed: Array
    freedom: Array

    @classmethod
    def joined(cls, parts: Sequence[EstimatedLevels]) -> EstimatedLevels | None:
        """Of several data; None of none."""
        if not parts:
            return None
        return cls(
            np.concatenate([part.heard for part in parts]),
            np.concatenate([part.weighed for part in parts]),
            np.concatenate([part.freedom for part in parts]),
        )

    def along(self, directions: Array) -> EstimatedLevels:
        """By combinations of the parameters, one a column."""
        heard, weighed = (directions.T @ part @ directions for part in (self.heard, self.weighed))
        return EstimatedLevels(heard, weighed, self.freedom)

    def added(self, covariance: Array) -> Array:
        """Covariance of the scores beyond what the weights promise, shape (n, n).

        Half of it is scatter that the accidents of the weights make, half what the promise lacks,
        for it is lowest where noise was taken for too small.

        Parameters
        ----------
        covariance : ndarray, shape (n, n)
            Of the estimates, by the weights.
        """
        met = self.weighed - self.heard @ covariance @ self.heard
        total = np.einsum("g,gij->ij", 4.0 / self.freedom, met)
        own, axes = np.linalg.eigh(0.5 * (total + total.T))
        return np.asarray((axes * np.maximum(own, 0.0)) @ axes.T)

    def doubt(self, solve: Array) -> Array:
        """Sum of squared variances over degrees of freedom, by estimate: see `freedom_of`.

        Parameters
        ----------
        solve : ndarray, shape (m, n)
            From scores to changes of the estimates.
        """
        variances = np.einsum("ki,gij,kj->gk", solve, self.heard, solve, optimize=True)
        return np.asarray(np.sum(variances**2 / self.freedom[:, None], axis=0))
