"""Cramér–Rao bounds in the convention of CIFER: from the Hessian of the cost, in no statistics.

These numbers rank parameters and are compared with the published guides. They are not confidence
intervals: the cost is not a likelihood. Intervals come from `flightid.uncertainty.response_errors`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.uncertainty.influence import require_apart, require_influence
from flightid.uncertainty.triangle import triangle_of_rows

Array = NDArray[np.float64]


def gauss_newton_hessian(jacobian: Array) -> Array:
    """Second derivatives of a sum of squares near its minimum, ℋ = 2 JᵀJ.

    Parameters
    ----------
    jacobian : ndarray, shape (n_residuals, n_parameters)
        Derivatives of the weighted residuals, whose squares add up to the cost.

    Returns
    -------
    ndarray, shape (n_parameters, n_parameters)

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., eq. 12.26.

    Example
    -------
    >>> gauss_newton_hessian(np.array([[3.0], [4.0]]))
    array([[50.]])
    """
    return np.asarray(2.0 * jacobian.T @ jacobian)


def inverse_hessian(jacobian: Array, names: Sequence[str] = ()) -> Array:
    """(2 JᵀJ)⁻¹ by orthogonal triangularisation, which keeps twice the digits of the product.

    Raises
    ------
    SingularError
        Some combination of the parameters has no influence on the residuals.

    Example
    -------
    >>> inverse_hessian(np.array([[3.0], [4.0]]))
    array([[0.02]])
    """
    scale = np.linalg.norm(jacobian, axis=0)
    require_influence(scale, names)
    triangle = triangle_of_rows(jacobian / scale)
    lacking = np.zeros(max(len(scale) - len(jacobian), 0))
    require_apart(np.concatenate([np.diag(triangle), lacking]), names)
    root = np.linalg.solve(triangle, np.eye(len(scale))) / scale[:, None]
    return np.asarray(0.5 * root @ root.T)


def cramer_rao(jacobian: Array, names: Sequence[str] = ()) -> Array:
    """Cramér–Rao bounds √(ℋ⁻¹)_ii in the units of the parameters.

    Parameters
    ----------
    jacobian : ndarray, shape (n_residuals, n_parameters)
        Derivatives of the weighted residuals, whose squares add up to the cost.
    names : sequence of str
        Of the parameters, for the error.

    Returns
    -------
    ndarray, shape (n_parameters,)

    Raises
    ------
    SingularError
        Some combination of the parameters has no influence on the residuals.

    Reference
    ---------
    Tischler & Remple, 2nd ed., eq. 12.27 and §12.3.4; guide: at most 20 % of the value.

    Example
    -------
    >>> cramer_rao(np.array([[1.0, 0.0], [0.0, 2.0]]))
    array([0.70710678, 0.35355339])
    """
    return np.asarray(np.sqrt(np.diag(inverse_hessian(jacobian, names))))


def correlation(covariance: Array) -> Array:
    """Correlation matrix of a covariance (or of an inverse Hessian).

    Parameters
    ----------
    covariance : ndarray, shape (n, n)

    Returns
    -------
    ndarray, shape (n, n)
        Ones on the diagonal.

    Reference
    ---------
    Tischler & Remple, 2nd ed., §12.3.4; guide: at most 0.98 in size.

    Example
    -------
    >>> correlation(np.array([[4.0, 1.0], [1.0, 1.0]]))
    array([[1. , 0.5],
           [0.5, 1. ]])
    """
    deviation = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / np.outer(deviation, deviation))
