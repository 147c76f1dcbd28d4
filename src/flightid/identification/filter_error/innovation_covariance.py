"""Covariance of a filter-error fit by the colour of its innovations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.identification.filter_error.innovations import RecordInnovations
from flightid.uncertainty.blocks import JointResiduals, RecordBlock
from flightid.uncertainty.coloured_residuals import ResidualCovariance, residual_covariance
from flightid.uncertainty.cramer_rao import inverse_hessian
from flightid.uncertainty.triangle import triangle_of_rows

Array = NDArray[np.float64]
LEAST_TOLD = 1e-3
"""Length of a noise's column, innovations of unit variance, from which its logarithm is told at
all: below, its standard error is above 1,000."""
LEAST_APART = 1e-8
"""Share of a column that those before it leave, down to which squares keep a digit."""


def told_noises(jacobian: Array, n_vehicle: int) -> NDArray[np.bool_]:
    """Which unknowns of a filter move its innovations; a noise that is none does not.

    Parameters
    ----------
    jacobian : ndarray, shape (n_rows, n)
        The vehicle's parameters first, noises after them.
    n_vehicle : int
        Those stay, whatever they do: what refuses them tells their names.

    Example
    -------
    >>> told_noises(np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]), 1)
    array([ True,  True, False])
    """
    scale = np.linalg.norm(jacobian, axis=0)
    diagonal = np.abs(np.diag(triangle_of_rows(jacobian / np.where(scale > 0.0, scale, 1.0))))
    told: NDArray[np.bool_] = scale > LEAST_TOLD
    told[: len(diagonal)] &= diagonal > LEAST_APART
    told[len(diagonal) :] = False
    told[:n_vehicle] = True
    return told


def innovation_covariance(
    filtered: Sequence[RecordInnovations],
    residuals: Array,
    jacobian: Array,
    names: Sequence[str],
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
    names : sequence of str
        Of the vehicle's parameters, which come first; noises after them that move nothing are left
        out before, see `told_noises`.

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
    noises = [f"noise {k + 1}" for k in range(jacobian.shape[1] - len(names))]
    inverse_hessian(jacobian, [*names, *noises])
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
    # A filter's own process noise follows what drifts, and `noise_doubt` asks what is unseen of it.
    rest = JointResiduals(still, still, measured=False)
    return residual_covariance(blocks, rest, drifts=False, asked=len(names))


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
