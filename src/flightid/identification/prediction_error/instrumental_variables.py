"""ARX coefficients by four-stage instrumental variables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.identification.prediction_error.coloured_errors import instrumental_covariance
from flightid.identification.prediction_error.excited_inputs import noise_free_inputs
from flightid.identification.prediction_error.linear_regression import (
    reflected,
    regress,
    regress_structure,
    require_errors,
)
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.recursive_filter import filtered
from flightid.uncertainty.coloured_residuals import ResidualCovariance

Array = NDArray[np.float64]
SPARE_LAGS = 8
ROWS_PER_LAG = 20


def four_stage(
    structure: PolynomialStructure, data: SampledChannels
) -> tuple[Array, ResidualCovariance]:
    """Coefficients of A y = B u + v with v of any colour, and their covariance.

    Least squares; instruments from its noise-free output; a long noise model of what is left; the
    same instruments again, everything filtered by that model. Consistent in open loop, and in a
    closed one where the channels hold what was injected: instruments are then what it alone moves.

    Raises
    ------
    DataError
        The instruments do not tell the coefficients apart, or leave no errors beside them.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 15.3, eqs. 15.20 to 15.27; Gilson & Van den
    Hof, Automatica 41 (2005), 241-249.
    """
    first, moved = regress_structure(structure, data).shortest, noise_free_inputs(data)
    second, _ = _instruments(structure, data, first, np.ones(1), moved)
    left = _left(structure, data, second)
    none = np.empty((0, left.size))
    # Longer than Ljung's na + nb: what a short noise model leaves coloured falsifies the intervals.
    room = sum(data.lengths) // ROWS_PER_LAG
    degree = min(structure.na + max(structure.nb, default=0) + SPARE_LAGS, max(room, 1))
    noise = regress(left, none, data.lengths, degree, [], [], levels=data.levels).shortest
    return _instruments(structure, data, second, np.concatenate([[1.0], noise]), moved)


def _filtered(above: Array, below: Array, row: Array, spans: Sequence[slice]) -> Array:
    return np.concatenate([filtered(above, below, row[span]) for span in spans])


def _numerators(structure: PolynomialStructure, theta: Array) -> list[Array]:
    parts = np.split(theta[structure.na :], np.cumsum(structure.nb)[:-1])
    return [np.concatenate([np.zeros(k), b]) for k, b in zip(structure.nk, parts, strict=True)]


def _left(structure: PolynomialStructure, data: SampledChannels, theta: Array) -> Array:
    a = np.concatenate([[1.0], theta[: structure.na]])
    left = _filtered(a, np.ones(1), data.output, data.spans)
    for row, b in zip(data.inputs, _numerators(structure, theta), strict=True):
        left -= _filtered(b, np.ones(1), row, data.spans)
    return left


def _instruments(
    structure: PolynomialStructure,
    data: SampledChannels,
    theta: Array,
    whitener: Array,
    moved: Array,
) -> tuple[Array, ResidualCovariance]:
    below = reflected(np.concatenate([[1.0], theta[: structure.na]]))
    clean = np.zeros_like(data.output)
    for row, b in zip(moved, _numerators(structure, theta), strict=True):
        clean += _filtered(b, below, row, data.spans)
    signals = [
        _filtered(whitener, np.ones(1), row, data.spans)
        for row in (data.output, clean, *data.inputs, *moved)
    ]
    # Before this row the filter has not seen the equation with all its lags.
    start = structure.longest_lag + whitener.size - 1
    m = len(data.inputs)
    regressors = _columns(structure, data, signals[0], signals[2 : 2 + m], start)
    instruments = _columns(structure, data, signals[1], signals[2 + m :], start)
    target = np.concatenate([signals[0][span][start:] for span in data.spans])
    ends = np.cumsum([n - start for n in data.lengths])[:-1]
    if data.levels:
        about = (np.split(part, ends) for part in (regressors, instruments, target))
        regressors, instruments, target = (
            np.concatenate([row - row.mean(axis=0) for row in rows]) for rows in about
        )
    levels = sum(n > start for n in data.lengths) if data.levels else 0
    require_errors(target.size - levels, regressors.shape[1])
    product = instruments.T @ regressors
    scale = np.outer(np.linalg.norm(instruments, axis=0), np.linalg.norm(regressors, axis=0))
    if np.any(scale == 0.0) or np.linalg.cond(product / scale) > 1e13:
        raise DataError(
            "the instruments do not tell the coefficients apart",
            found=f"{structure.na} poles and inputs {', '.join(structure.inputs)}",
            action="lower the orders or use a richer input",
        )
    found = np.linalg.solve(product, instruments.T @ target)
    parts = (instruments, regressors, target - regressors @ found)
    return found, instrumental_covariance(*(np.split(part, ends) for part in parts))


def _columns(
    structure: PolynomialStructure,
    data: SampledChannels,
    output: Array,
    inputs: Sequence[Array],
    start: int,
) -> Array:
    lags = [(output, lag, -1.0) for lag in range(1, structure.na + 1)]
    for row, count, delay in zip(inputs, structure.nb, structure.nk, strict=True):
        lags += [(row, lag, 1.0) for lag in range(delay, delay + count)]
    return np.array(
        [
            np.concatenate(
                [sign * row[span][start - lag : n - lag]
                 for span, n in zip(data.spans, data.lengths, strict=True)]
            )
            for row, lag, sign in lags
        ]
    ).T  # fmt: skip
