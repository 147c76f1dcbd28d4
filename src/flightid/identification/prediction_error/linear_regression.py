"""Least squares of A y = Σ B u + e from one triangle (native side: `polynomial_fit.rs`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError, FitError
from flightid.frozen import dataclass
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels

Array = NDArray[np.float64]
WORTH = 4e5
"""Rows times squared regressors from which their products are quicker than their triangle."""
FEWEST_DIGITS = 1e-4
"""Least pivot of the products, of unit diagonal: half of the digits are left there."""
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
        """Shortest coefficients among those that fit best: safe where regressors are collinear.

        Raises
        ------
        FitError
            Regressors run away: their triangle holds no finite numbers.
        """
        if not np.all(np.isfinite(self.triangle)):
            raise FitError(
                "a regression ran away",
                found="regressors without finite numbers",
                needed="channels whose filtered samples stay finite",
                action="lower the orders, or look for outliers and unlike scales in the records",
            )
        scale = np.linalg.norm(self.factor, axis=0)
        scale[scale == 0.0] = 1.0
        # No singular value is less than this bound, times √n, over the largest: none is left out.
        if scipy.linalg.lapack.dtrcon(self.factor / scale)[0] > len(scale) * SMALLEST:
            return self.theta
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
    *,
    levels: bool = False,
) -> LinearRegression:
    """Fit A y = Σ B u + e, with `levels` a constant of each record too, which is not shown.

    Rows whose lags reach before a record are left out by default.
    """
    if na and not nb and skip is None:
        return _autoregression(output, lengths, na, levels=levels)
    spans = [n + k - 1 for n, k in zip(nb, nk, strict=True) if n]
    orders = (na, list(nb), 0, 0, [0] * len(nb), list(nk))
    first = max([na, *spans]) if skip is None else skip
    theta, flat, n_rows, dependent = _native.polynomial_regression(
        output, np.ascontiguousarray(inputs), list(lengths), orders, first, levels
    )
    width = theta.size + 1
    return LinearRegression(theta, flat.reshape(width, width).T, n_rows, dependent)


def regress_structure(
    structure: PolynomialStructure, data: SampledChannels, skip: int | None = None
) -> LinearRegression:
    """`regress` with A and B of a structure, for the channels of all records."""
    return regress(
        data.output,
        data.inputs,
        data.lengths,
        structure.na,
        structure.nb,
        structure.nk,
        skip,
        levels=data.levels,
    )


def regress_lags(
    output: Array, inputs: Array, lengths: Sequence[int], n: int, skip: int, *, levels: bool
) -> LinearRegression:
    """Fit y = Σ B u + e, every B of `n` coefficients from lag 0, with `skip` from n - 1 rows out.

    Many lags go by their products, each of which follows from that one lag before; where these
    lose too many digits, by their triangle.
    """
    count = len(inputs)
    if (n * count) ** 2 * output.size < WORTH or min(lengths) <= n + skip:
        return regress(output, inputs, lengths, 0, [n] * count, [0] * count, skip, levels=levels)
    products = np.zeros((n * count + 1, n * count + 1))
    start, rows = 0, 0
    # What runs away goes by its triangle.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for length in lengths:
            span = slice(start, start + length)
            products += _products(output[span], inputs[:, span], n, skip)
            if levels:
                sums = _sums(output[span], inputs[:, span], n, skip)
                products -= np.outer(sums, sums) / (length - skip)
            start, rows = start + length, rows + length - skip - levels
        scale = np.sqrt(np.diag(products))
        try:
            lower = np.linalg.cholesky(products / np.outer(scale, scale))
        except np.linalg.LinAlgError:
            lower = np.zeros((1, 1))
    if not np.diag(lower).min() > FEWEST_DIGITS:
        return regress(output, inputs, lengths, 0, [n] * count, [0] * count, skip, levels=levels)
    triangle = (scale[:, None] * lower).T
    theta = -scipy.linalg.solve_triangular(triangle[:-1, :-1], triangle[:-1, -1])
    return LinearRegression(np.asarray(theta), triangle, rows, None)


def _autoregression(
    output: Array, lengths: Sequence[int], na: int, *, levels: bool
) -> LinearRegression:
    """`regress` of outputs on themselves: on what they were a sample before, as on an input."""
    ends = np.cumsum(lengths)
    late = np.delete(output, ends - np.asarray(lengths))
    early = -np.delete(output, ends - 1)[None]
    before = [length - 1 for length in lengths]
    return regress_lags(late, early, before, na, na - 1, levels=levels)


def _products(output: Array, inputs: Array, n: int, skip: int) -> Array:
    """Gram matrix of [-lagged inputs | output] of one record, from row `skip`."""
    count, last = len(inputs), output.size
    y = output[skip:]
    found = np.zeros((n * count + 1, n * count + 1))
    found[-1, -1] = y @ y
    for i, left in enumerate(inputs):
        mine = slice(i * n, (i + 1) * n)
        found[mine, -1] = found[-1, mine] = -_with_lags(left, y, n, skip)
        for j, right in enumerate(inputs[: i + 1]):
            block = np.zeros((n, n))
            block[:, 0] = _with_lags(left, right[skip:], n, skip)
            block[0] = block[:, 0] if i == j else _with_lags(right, left[skip:], n, skip)
            # A lag later: one row more at the beginning, one less at the end.
            early = np.outer(left[skip - n + 1 : skip][::-1], right[skip - n + 1 : skip][::-1])
            late = np.outer(left[last - n + 1 :][::-1], right[last - n + 1 :][::-1])
            change = early - late
            for k in range(n - 1):
                block[k + 1, 1:] = block[k, :-1] + change[k]
            found[mine, j * n : (j + 1) * n] = block
            found[j * n : (j + 1) * n, mine] = block.T
    return found


def _with_lags(lagged: Array, row: Array, n: int, skip: int) -> Array:
    """Products of a row from sample `skip` with a channel so many samples before."""
    return np.correlate(lagged[skip - n + 1 :], row, "valid")[::-1]


def _sums(output: Array, inputs: Array, n: int, skip: int) -> Array:
    """Sums of [-lagged inputs | output] of one record, from row `skip`."""
    sums = np.concatenate([np.zeros((len(inputs), 1)), np.cumsum(inputs, axis=1)], axis=1)
    lag, last = np.arange(n), output.size
    lagged = sums[:, last - lag] - sums[:, skip - lag]
    return np.concatenate([-lagged.ravel(), [output[skip:].sum()]])


def inverse_square(factor: Array) -> Array:
    """(RᵀR)⁻¹ of a triangle, shape (n, n)."""
    upper = np.triu(scipy.linalg.lapack.dpotri(factor)[0])
    return np.asarray(upper + np.triu(upper, 1).T)


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


def require_errors(n_rows: int, n_coefficients: int) -> None:
    """Refuse equations that coefficients meet exactly: nothing is left to judge them by.

    Raises
    ------
    DataError
        No more equations than coefficients.
    """
    if n_rows <= n_coefficients:
        raise DataError(
            "the records leave no errors beside the coefficients",
            found=f"{n_rows} equations of {n_coefficients} coefficients",
            needed="more equations than coefficients",
            action="lower the orders, or take longer records",
        )


def reflected(polynomial: Array) -> Array:
    """A polynomial in q⁻¹ that can be divided by: roots outside the unit circle moved inside.

    Example
    -------
    >>> reflected(np.array([1.0, -2.0])).round(2)
    array([ 1. , -0.5])
    """
    if _stable(polynomial):
        return polynomial
    roots = np.roots(polynomial)
    size = np.abs(roots)
    if not np.any(size >= 1.0):
        return polynomial
    inside = np.where(size >= 1.0, roots / np.maximum(size, 1.0) ** 2 * (1 - 1e-3), roots)
    tail = np.zeros(polynomial.size - 1 - roots.size)
    return np.concatenate([np.asarray(np.real(np.poly(inside))), tail])


def _stable(polynomial: Array) -> bool:
    """Whether all roots are inside the unit circle (Schur and Cohn's reflections)."""
    rest: list[float] = (polynomial / polynomial[0]).tolist()
    while len(rest) > 1:
        last = rest[-1]
        if not abs(last) < 1.0:
            return False
        turned = rest[::-1]
        rest = [(a - last * b) / (1.0 - last * last) for a, b in zip(rest, turned, strict=True)]
        rest.pop()
    return True
