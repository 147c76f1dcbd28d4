"""Subspace estimates of innovations models: PO-MOESP, N4SID, CVA and predictor-based PBSID."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.subspace.data import (
    RowSpaceFactor,
    SubspaceData,
    compress,
    require_columns,
)
from flightid.identification.subspace.matrices import (
    STABLE,
    feedthrough,
    kalman_gain,
    stabilised,
    steady_gain,
)
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.sampled.recursion import spectral_radius

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array, Array]
RANK = 1e-10
"""Singular values below this share of the largest are rounding."""


@dataclass(frozen=True, eq=False)
class Subspace:
    """What past and future of the records say before an order is chosen.

    Attributes
    ----------
    singular_values : ndarray
        Of the method's own weighting; MOESP: those of the block of the triangular factor that
        relates past to future, not normalised.
    correlations : ndarray
        Canonical correlations of past and future, the inputs of the future taken out.
    horizon : int
        Block rows of past and of future.
    n_columns : int
        Columns of the Hankel matrices of all records.
    """

    singular_values: Array
    correlations: Array
    horizon: int
    n_columns: int
    observability: Array
    states: Array | None
    compressed: RowSpaceFactor | None


def decompose(structure: SubspaceStructure, data: SubspaceData) -> Subspace:
    """Singular values and observability of all orders at once.

    Reference: Verhaegen (1994), *Automatica* 30; Van Overschee & De Moor, *Subspace Identification
    for Linear Systems* (1996), theorems 2 and 12 and section 4.3; Chiuso (2007), *Automatica* 43.
    """
    horizon = data.horizon(structure)
    if structure.method == "pbsid":
        return _predictor_based(structure, data, horizon)
    packed = compress(data, horizon)
    future, noise, past = packed.future_on_past, packed.future_noise, packed.oblique()
    joint = np.hstack([future, noise])
    left, sizes, right = np.linalg.svd(joint, full_matrices=False)
    kept = sizes > RANK * max(sizes[0], 1e-300)
    whitened = right[kept][:, : future.shape[1]]
    turn, correlations = _left(whitened)
    correlations = np.asarray(np.minimum(correlations, 1.0), dtype=np.float64)
    if structure.method == "cva":
        shaped = left[:, kept] * sizes[kept] @ turn
        vectors, values = np.asarray(shaped), np.asarray(correlations)
    else:
        vectors, values = _left(future if structure.method == "moesp" else past)
    # In the unit of one output; several outputs have none in common.
    scale = float(data.scales[0]) if len(data.scales) == 1 else 1.0
    shown = values if structure.method == "cva" else values * scale
    gamma = vectors * np.sqrt(values)
    return Subspace(shown, correlations, horizon, packed.n_columns, gamma, None, packed)


def realise(
    structure: SubspaceStructure, data: SubspaceData, found: Subspace, order: int
) -> Matrices:
    """A, B, C, D, K of one order, in the channels' units."""
    return realised(structure, data, found, order)[0]


def realised(
    structure: SubspaceStructure, data: SubspaceData, found: Subspace, order: int
) -> tuple[Matrices, float | None]:
    """The same, and squares of its errors; None where no least squares told them.

    Errors of outputs of unit size, with the best start of each record and the best levels.
    """
    _require_rank(found, order)
    squares = None
    if found.compressed is None:
        a, b, c, d, k = _from_states(structure, data, found, order)
    else:
        p = data.n_outputs
        gamma = found.observability[:, :order]
        c = gamma[:p]
        a = np.asarray(np.linalg.lstsq(gamma[:-p], gamma[p:], rcond=None)[0], dtype=np.float64)
        a = stabilised(a) if structure.enforce_stability else a
        k = kalman_gain(a, c, *found.compressed.residual_covariance(gamma, a, c))
        b, d, squares = feedthrough(data, a, c, k, direct=bool(structure.direct))
    size = data.scales
    return (a, b, size[:, None] * c, size[:, None] * d, k / size), squares


def _left(matrix: Array) -> tuple[Array, Array]:
    """Left singular vectors and singular values."""
    left, values, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(left, dtype=np.float64), np.asarray(values, dtype=np.float64)


def _require_rank(found: Subspace, order: int) -> None:
    values = found.singular_values
    rank = int(np.sum(values > RANK * max(values[0], 1e-300)))
    if order > rank:
        raise DataError(
            "the order is larger than the records support",
            found=f"order {order}, {rank} singular values above rounding",
            needed=f"at most {rank}",
            action="lower the order, or leave it out and see the singular values",
        )


def _predictor_based(structure: SubspaceStructure, data: SubspaceData, horizon: int) -> Subspace:
    """Long autoregression first: its innovations free the states of the feedback."""
    past, now, inputs = data.lagged(horizon)
    p, block = data.n_outputs, data.n_outputs + data.n_inputs
    rows = np.vstack([past, inputs]) if structure.direct else past
    require_columns(rows.shape[1], rows.shape[0] + p, horizon)
    # Columns of one size, so that the rank test does not depend on units.
    size = np.linalg.norm(rows, axis=1)
    scaled = rows / np.where(size > 0.0, size, 1.0)[:, None]
    triangle = np.asarray(np.linalg.qr(scaled.T, mode="r"))
    if np.linalg.cond(triangle) > 1.0 / RANK:
        raise DataError(
            "past inputs and outputs are not independent",
            found="a long autoregression without a unique answer",
            needed="noise and an input that is rich enough",
            action="take method='moesp' for records without noise, or a shorter horizon",
        )
    weights = np.linalg.lstsq(rows.T, now.T, rcond=None)[0].T
    errors = now - weights @ rows
    noise = errors @ errors.T / errors.shape[1]
    lags = weights[:, : past.shape[0]]
    gamma = np.zeros((p * horizon, past.shape[0]))
    for step in range(horizon):
        gamma[step * p : (step + 1) * p, step * block :] = lags[:, : (horizon - step) * block]
    whiten = np.linalg.inv(np.linalg.cholesky(noise))
    weighted = np.kron(np.eye(horizon), whiten) @ gamma
    # Only the triangle of the past is needed for the singular values.
    base = np.asarray(np.linalg.qr(past.T, mode="r"))
    left, values, _ = np.linalg.svd(weighted @ base.T, full_matrices=False)
    states = (left.T @ weighted @ past) / np.sqrt(np.where(values > 0, values, 1.0))[:, None]
    ratio = values**2 / past.shape[1]
    correlations = np.sqrt(ratio / (1.0 + ratio))
    return Subspace(values, correlations, horizon, past.shape[1], gamma, states, None)


def _from_states(
    structure: SubspaceStructure, data: SubspaceData, found: Subspace, order: int
) -> Matrices:
    """Outputs on states, then next states on states, inputs and innovations."""
    states = np.asarray(found.states)[:order]
    _, now, inputs = data.lagged(found.horizon)
    m = data.n_inputs
    rows = np.vstack([states, inputs]) if structure.direct else states
    ahead = np.linalg.lstsq(rows.T, now.T, rcond=None)[0].T
    errors = now - ahead @ rows
    d = ahead[:, order:] if structure.direct else np.zeros((data.n_outputs, m))
    before, after = data.neighbours(found.horizon)
    rows = np.vstack([states, inputs, errors])[:, before]
    moved = np.linalg.lstsq(rows.T, states[:, after].T, rcond=None)[0].T
    a, b, k = np.split(moved, [order, order + m], axis=1)
    c = ahead[:, :order]
    if structure.enforce_stability and spectral_radius(a) >= STABLE:
        a = stabilised(a)
        k = steady_gain(a, c, k, errors @ errors.T / errors.shape[1])
        b, d, _ = feedthrough(data, a, c, k, direct=bool(structure.direct))
        return a, b, c, d, k
    return a, b, c, d, steady_gain(a, c, k, errors @ errors.T / errors.shape[1])
