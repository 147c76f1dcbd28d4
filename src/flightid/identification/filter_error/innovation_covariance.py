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
        turn = _own_outputs(each.filter.innovation)
        basis = _by_output(each.space, n, p, turn)
        blocks.append(
            RecordBlock(
                _by_output(jacobian[rows], n, p, turn),
                np.zeros((basis.shape[1], jacobian.shape[1])),
                basis,
                np.eye(basis.shape[1]),
                np.ascontiguousarray(turn @ residuals[rows].reshape(n, p).T),
            )
        )
    still = jacobian[first:]
    return residual_covariance(blocks, JointResiduals(still, still, measured=False))


def _own_outputs(innovation: Array) -> Array:
    """Turns innovations that a triangle whitened to those that a symmetric root whitens.

    A triangle takes the first outputs out of the last; the root of correlations, by each output's
    own deviation, knows no order and no units, and so does the colour of what it leaves.
    """
    triangle = np.linalg.cholesky(innovation)
    size = np.sqrt(np.diag(innovation))
    values, along = np.linalg.eigh(innovation / np.outer(size, size))
    return np.asarray((along / np.sqrt(values)) @ along.T @ (triangle / size[:, None]))


def _by_output(rows: Array, n_samples: int, n_outputs: int, turn: Array) -> Array:
    """Rows of samples after samples, turned, as rows of outputs after outputs."""
    turned = np.tensordot(turn, rows.reshape(n_samples, n_outputs, -1), axes=(1, 1))
    return np.ascontiguousarray(turned).reshape(n_samples * n_outputs, -1)
