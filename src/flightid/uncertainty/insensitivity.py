"""Insensitivity of the cost to single parameters, and combinations that the data cannot see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.uncertainty.influence import require_influence
from flightid.uncertainty.triangle import triangle_of_rows

Array = NDArray[np.float64]


def insensitivity(jacobian: Array, names: Sequence[str] = ()) -> Array:
    """Insensitivity 1/√ℋ_ii: the change of one parameter alone that raises the cost by one half.

    Parameters
    ----------
    jacobian : ndarray, shape (n_residuals, n_parameters)
        Derivatives of the weighted residuals, whose squares add up to the cost.
    names : sequence of str
        Of the parameters, for the error.

    Returns
    -------
    ndarray, shape (n_parameters,)
        In the units of the parameters.

    Raises
    ------
    SingularError
        A parameter has no influence on the residuals.

    Reference
    ---------
    Tischler & Remple, 2nd ed., eq. 12.28; guide: at most 10 % of the value.

    Example
    -------
    >>> insensitivity(np.array([[3.0], [4.0]]))
    array([0.14142136])
    """
    size = np.linalg.norm(jacobian, axis=0)
    require_influence(size, names)
    return np.asarray(1.0 / (np.sqrt(2.0) * size))


def null_combination(jacobian: Array, *, tolerance: float = 1e-9) -> Array | None:
    """Combination of parameters that leaves the residuals as they are, where there is one.

    Parameters
    ----------
    jacobian : ndarray, shape (n_residuals, n_parameters)
        Derivatives of the residuals.
    tolerance : float
        Smallest singular value, relative to the largest, of columns scaled to equal length.

    Returns
    -------
    ndarray, shape (n_parameters,), or None
        Share of each parameter, scaled by its influence, largest 1; None where all combinations
        are seen.

    Reference
    ---------
    Golub & Van Loan, *Matrix Computations*, 4th ed., §5.4.

    Example
    -------
    >>> null_combination(np.array([[1.0, 2.0], [2.0, 4.0]]))
    array([1., 1.])
    """
    size = np.linalg.norm(jacobian, axis=0)
    if np.any(size == 0.0):
        return np.asarray((size == 0.0).astype(np.float64))
    n = len(size)
    # The triangle has the same singular values, without a left basis of thousands of rows.
    triangle = triangle_of_rows(jacobian / size)
    # Directions cost several times as much, and are wanted only where one is blind.
    values = np.linalg.svd(triangle, compute_uv=False)
    if len(values) == n and values[-1] > tolerance * values[0]:
        return None
    right = np.linalg.svd(triangle, full_matrices=True)[2]
    share = np.abs(right[-1])
    return np.asarray(share / share.max())
