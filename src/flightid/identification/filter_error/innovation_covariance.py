"""Covariance of a filter-error fit by the colour of its innovations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.identification.filter_error.innovations import RecordInnovations
from flightid.uncertainty.blocks import JointResiduals, RecordBlock
from flightid.uncertainty.coloured_residuals import ResidualCovariance, residual_covariance
from flightid.uncertainty.cramer_rao import inverse_hessian

Array = NDArray[np.float64]


def innovation_covariance(
    filtered: Sequence[RecordInnovations], residuals: Array, jacobian: Array
) -> ResidualCovariance:
    """Covariance of parameters and noises, whether the innovations are white or not.

    The filter is right where they are; a gust that is no white noise, or dynamics that the model
    lacks, leave them coloured, and the inverse information is too small.

    Parameters
    ----------
    filtered : sequence of RecordInnovations
        By record, at the estimate.
    residuals : ndarray, shape (n_rows + n_still,)
        Of unit variance: whitened innovations, samples after samples of record after record; then
        the rows without residual that bring the curvature of the variances.
    jacobian : ndarray, shape (n_rows + n_still, n)
        Derivatives of `residuals`.

    Raises
    ------
    SingularError
        Some combination of the unknowns has no influence on the residuals.

    Assumes
    -------
    Slopes that are known, as those of a filter in the limit of long records are.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., eqs. 9.41 and 9.42; Morelli & Klein (1997), J.
    Guidance, Control and Dynamics 20(1), eqs. 19-25.
    """
    inverse_hessian(jacobian)
    blocks, first = [], 0
    for each in filtered:
        n, p = each.innovations.shape
        rows = slice(first, first + n * p)
        first = rows.stop
        basis = _by_output(each.space, n, p)
        blocks.append(
            RecordBlock(
                _by_output(jacobian[rows], n, p),
                np.zeros((basis.shape[1], jacobian.shape[1])),
                basis,
                np.eye(basis.shape[1]),
                np.ascontiguousarray(residuals[rows].reshape(n, p).T),
            )
        )
    still = jacobian[first:]
    return residual_covariance(blocks, JointResiduals(still, still, measured=False))


def _by_output(rows: Array, n_samples: int, n_outputs: int) -> Array:
    """Rows of samples after samples as rows of outputs after outputs."""
    turned = rows.reshape(n_samples, n_outputs, -1).swapaxes(0, 1)
    return np.ascontiguousarray(turned).reshape(n_samples * n_outputs, -1)
