"""Least squares of A y = Σ B u + e from one triangle (native side: `polynomial_fit.rs`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError
from flightid.models.polynomial.structure import PolynomialStructure

Array = NDArray[np.float64]
SMALLEST = 1e-10
"""Directions with a smaller share of the largest singular value are left alone by a start."""


@dataclass(frozen=True, eq=False)
class LinearRegression:
    """Coefficients and the triangle of [regressors | output] with `n_rows` rows behind it."""

    theta: Array
    triangle: Array
    n_rows: int
    dependent: int | None

    @property
    def factor(self) -> Array:
        """Triangle of the regressors, shape (n, n)."""
        return self.triangle[:-1, :-1]

    @property
    def sum_of_squares(self) -> float:
        """Of the residuals."""
        return float(self.triangle[-1, -1] ** 2)

    @property
    def shortest(self) -> Array:
        """Shortest coefficients among those that fit best: safe where regressors are collinear."""
        scale = np.linalg.norm(self.factor, axis=0)
        scale[scale == 0.0] = 1.0
        wanted = -self.triangle[:-1, -1]
        return np.asarray(np.linalg.lstsq(self.factor / scale, wanted, rcond=SMALLEST)[0] / scale)


def regress(
    output: Array,
    inputs: Array,
    lengths: Sequence[int],
    na: int,
    nb: Sequence[int],
    nk: Sequence[int],
    skip: int | None = None,
) -> LinearRegression:
    """Fit A y = Σ B u + e; rows whose lags reach before a record are left out by default."""
    spans = [n + k - 1 for n, k in zip(nb, nk, strict=True) if n]
    orders = (na, list(nb), 0, 0, [0] * len(nb), list(nk))
    first = max([na, *spans]) if skip is None else skip
    theta, flat, n_rows, dependent = _native.polynomial_regression(
        output, np.ascontiguousarray(inputs), list(lengths), orders, first
    )
    width = theta.size + 1
    return LinearRegression(theta, flat.reshape(width, width).T, n_rows, dependent)


def require_independent(regression: LinearRegression, structure: PolynomialStructure) -> None:
    """Refuse a regression whose coefficients the data cannot tell apart.

    Raises
    ------
    DataError
        A regressor is a combination of those before it.
    """
    if regression.dependent is not None:
        raise DataError(
            "the data cannot tell the coefficients apart",
            found=f"the regressor of {structure.names[regression.dependent]} is a combination of "
            "those before it",
            needed="an input that excites more frequencies than the model has coefficients",
            action="lower the orders, drop one of two equal inputs, or use a richer input "
            "(flightid.advise says how rich it is)",
        )


def reflected(polynomial: Array) -> Array:
    """A polynomial in q⁻¹ that can be divided by: roots outside the unit circle moved inside.

    Example
    -------
    >>> reflected(np.array([1.0, -2.0])).round(2)
    array([ 1. , -0.5])
    """
    roots = np.roots(polynomial)
    size = np.abs(roots)
    if not np.any(size >= 1.0):
        return polynomial
    inside = np.where(size >= 1.0, roots / np.maximum(size, 1.0) ** 2 * (1 - 1e-3), roots)
    tail = np.zeros(polynomial.size - 1 - roots.size)
    return np.concatenate([np.asarray(np.real(np.poly(inside))), tail])
