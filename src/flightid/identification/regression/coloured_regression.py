"""Covariance of least squares on several records whose residuals are coloured in time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.identification.records.statistics import (
    Block,
    covariances,
    information_inverse,
    triangle_of,
)

Array = NDArray[np.float64]


def coloured_covariance(
    weighed: Sequence[tuple[Array, Array]], constants: Sequence[Array]
) -> tuple[Array, Array, float]:
    """Covariance, its degrees of freedom, and the largest inflation against white residuals.

    Parameters
    ----------
    weighed : sequence of tuple of ndarray
        Residuals (n_equations, n_rows) and slopes (n_equations, n_rows, n) of each record, of unit
        variance, with the record's constants taken out.
    constants : sequence of ndarray, shape (n_equations · n_rows, n_constants)
        Orthonormal directions that the constants of each record follow.

    Returns
    -------
    covariance : ndarray, shape (n, n)
    freedom : ndarray, shape (n,)
    inflation : float
        Ratio of standard errors.

    Reference
    ---------
    Morelli & Klein (1997), J. Guidance, Control and Dynamics 20(1), eqs. 19-25.
    """
    blocks = []
    for (residuals, slopes), basis in zip(weighed, constants, strict=True):
        n, k = slopes.shape[2], basis.shape[1]
        flat = np.ascontiguousarray(slopes.reshape(-1, n))
        blocks.append(Block(flat, np.zeros((k, n)), basis, np.eye(k), residuals))
    triangle = triangle_of(blocks)
    covariance, _, _, freedom = covariances(blocks, triangle)
    plain = np.diag(information_inverse(triangle))
    inflation = float(np.max(np.sqrt(np.diag(covariance) / plain), initial=1.0))
    return covariance, freedom, inflation
