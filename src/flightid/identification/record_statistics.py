"""How well a time-domain fit knows its numbers: intervals that allow for coloured residuals.

Residuals are whitened across outputs by R. Each record's own numbers are taken out of the
sensitivities by orthogonal projection, so the parameters that all records share meet in one small
information matrix. The noise of each whitened output gets an autoregressive model whose
autocovariance replaces "white" in the covariance of the estimates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from flightid.conditioning.coloured_residuals import (
    Autoregression,
    noise_models,
    toeplitz_product,
)
from flightid.identification.estimates import at_bound, fitted_parameters, require_identifiable
from flightid.identification.fit import FittedParameter
from flightid.identification.record_setup import OwnNumbers, RecordSet
from flightid.inference import correlation as correlation_of
from flightid.inference import interval95
from flightid.models import Model, StateSpaceModel

Array = NDArray[np.float64]
Own = tuple[dict[str, FittedParameter], dict[str, FittedParameter], dict[str, FittedParameter]]
UNDETERMINED = "the record does not tell it apart from the others of its own numbers"


@dataclass(frozen=True)
class RecordStatistics:
    """What is known of the estimates.

    Attributes
    ----------
    parameters : mapping of str to FittedParameter
    names : tuple of str
        Order of `covariance` and `correlation`.
    covariance, correlation : ndarray
        The first corrected for coloured residuals, the second of the plain information.
    own : list of tuple
        Initial state, biases, reference shifts of each record.
    inflation : float
        Largest ratio of a corrected standard error to that for white residuals.
    """

    parameters: Mapping[str, FittedParameter]
    names: tuple[str, ...]
    covariance: Array
    correlation: Array
    own: list[Own]
    inflation: float


@dataclass(frozen=True)
class Block:
    """One record, whitened; rows are outputs after outputs.

    Sensitivities with own numbers taken out, and an orthonormal basis and triangle of the own
    numbers' sensitivities.
    """

    projected: Array
    shared_on_own: Array
    basis: Array
    triangle: Array
    residual: Array

    @classmethod
    def of(cls, shared: Array, own: Array, residual: Array) -> Block:
        """From whitened sensitivities by shared parameters and by own numbers."""
        rows = residual.size
        shared, own = shared.reshape(rows, -1), own.reshape(rows, -1)
        basis, triangle = np.linalg.qr(own)
        on_own = basis.T @ shared
        return cls(shared - basis @ on_own, on_own, basis, triangle, residual)


def record_statistics(
    fitted: Model,
    prepared: RecordSet,
    own: Sequence[OwnNumbers],
    determined: Sequence[Sequence[bool]],
    runs: Sequence[tuple[Array, Array]],
    noise: Array,
    limit: float,
    beside: Array | None = None,
) -> RecordStatistics:
    """Standard errors, bounds and correlations of a fit to records.

    `beside` are the slopes, by all free parameters, of residuals of unit variance from other data
    that were fitted together with the records.

    Raises
    ------
    FitError
        The records do not see a parameter, or a combination of parameters.

    Reference
    ---------
    Morelli & Klein (1997), J. Guidance, Control and Dynamics 20(1), eqs. 19-25; the elimination:
    Golub & Pereyra (1973), SIAM J. Numerical Analysis 10.
    """
    free = fitted.parameters.free
    inner = np.array([not at_bound(parameter) for parameter in free], dtype=bool)
    names = tuple(p.name for p, keep in zip(free, inner, strict=True) if keep)
    whitener = np.linalg.inv(np.linalg.cholesky(noise))
    blocks = []
    for (_, measured, _), (outputs, slopes), kept in zip(
        prepared.arrays, runs, determined, strict=True
    ):
        white = np.tensordot(whitener, slopes, axes=1)
        residual = _limited(whitener @ (measured - outputs), limit)
        shared, rest = white[:, :, : len(free)][:, :, inner], white[:, :, len(free) :]
        blocks.append(Block.of(shared, rest[:, :, np.array(kept, dtype=bool)], residual))
    other = np.zeros((0, len(free))) if beside is None else beside
    triangle = triangle_of(blocks, other[:, inner])
    require_identifiable(names, triangle)
    covariance, own_covariances, crossed, models = covariances(blocks, triangle, other[:, inner])
    plain = information_inverse(triangle)
    freedom = freedom_of(blocks, models, triangle, other[:, inner])
    parameters = fitted_parameters(fitted, names, covariance, triangle / np.sqrt(2.0), freedom)
    ratio = np.sqrt(np.diag(covariance) / np.diag(plain)) if names else np.ones(1)
    return RecordStatistics(
        parameters,
        names,
        covariance,
        correlation_of(plain) if names else np.zeros((0, 0)),
        [
            _own_numbers(
                fitted, prepared, numbers, kept, found, start_errors(numbers, kept, inner, joint)
            )
            for numbers, kept, found, joint in zip(
                own,
                determined,
                own_covariances,
                (
                    np.block([[covariance, cross.T], [cross, each]])
                    for cross, each in zip(crossed, own_covariances, strict=True)
                ),
                strict=True,
            )
        ],
        float(np.max(ratio)),
    )


def _limited(residual: Array, limit: float) -> Array:
    """What an estimate with a limited loss feels of whitened residuals (Huber 1981, eq. 7.6.6)."""
    if np.isinf(limit):
        return residual
    inside = np.mean(np.abs(residual) <= limit, axis=1, keepdims=True)
    return np.asarray(np.clip(residual, -limit, limit) / inside)


def triangle_of(blocks: Sequence[Block], beside: Array | None = None) -> Array:
    """Triangle of the sensitivities of all records, and of what is fitted beside them."""
    parts = [np.asarray(np.linalg.qr(block.projected, mode="r")) for block in blocks]
    if beside is not None:
        parts.append(beside)
    return np.asarray(np.linalg.qr(np.vstack(parts), mode="r"))


def information_inverse(triangle: Array) -> Array:
    """(RᵀR)⁻¹ of a triangle R: the covariance for white residuals of unit variance."""
    size = np.linalg.norm(triangle, axis=0)
    root = solve_triangular(triangle / size, np.eye(len(size))) / size[:, None]
    return np.asarray(root @ root.T)


def _noise_covariance(models: Sequence[Autoregression], columns: Array, n_outputs: int) -> Array:
    """columnsᵀ Ω columns for the noise Ω of one record."""
    n_samples = len(columns) // n_outputs
    parts = columns.reshape(n_outputs, n_samples, columns.shape[1])
    total = np.zeros((columns.shape[1], columns.shape[1]))
    for model, part in zip(models, parts, strict=True):
        total += part.T @ toeplitz_product(model.autocovariance(len(part)), part)
    return total


def _share_beside(plain: Array, beside: Array | None) -> Array:
    """Covariance that residuals of unit variance beside the records bring into the estimates."""
    if beside is None:
        return np.zeros_like(plain)
    gain = beside @ plain
    return np.asarray(gain.T @ gain)


def covariances(
    blocks: Sequence[Block], triangle: Array, beside: Array | None = None
) -> tuple[Array, list[Array], list[Array], list[Autoregression]]:
    """Covariance of the shared parameters, of each record's own, between the two; noise models."""
    plain = information_inverse(triangle)
    n_outputs = blocks[0].residual.shape[0]

    def left(drawn: list[Array]) -> list[Array]:
        flat = [
            each.reshape(block.residual.size, -1) for each, block in zip(drawn, blocks, strict=True)
        ]
        moved = plain @ sum(
            block.projected.T @ each for block, each in zip(blocks, flat, strict=True)
        )
        return [
            (each - block.basis @ (block.basis.T @ each) - block.projected @ moved).reshape(
                whole.shape
            )
            for block, each, whole in zip(blocks, flat, drawn, strict=True)
        ]

    models = noise_models([block.residual for block in blocks], left)
    gains = [block.projected @ plain for block in blocks]
    parts = [_noise_covariance(models, gain, n_outputs) for gain in gains]
    shared = np.asarray(sum(parts)) + _share_beside(plain, beside)
    own, crossed = [], []
    for block, gain, part in zip(blocks, gains, parts, strict=True):
        # Own numbers answer the record's own noise and, through the parameters, everybody's.
        back = np.linalg.inv(block.triangle)
        direct = (block.basis - gain @ block.shared_on_own.T) @ back.T
        through = back @ block.shared_on_own
        own.append(
            _noise_covariance(models, direct, n_outputs) + through @ (shared - part) @ through.T
        )
        both = _noise_covariance(models, np.hstack([direct, gain]), n_outputs)
        crossed.append(both[: direct.shape[1], direct.shape[1] :] - through @ (shared - part))
    return shared, own, crossed, models


def start_errors(
    numbers: OwnNumbers, kept: Sequence[bool], inner: NDArray[np.bool_], joint: Array
) -> Array | None:
    """Standard errors of an initial state that follows from conditions at both ends of a record.

    Parameters
    ----------
    numbers : OwnNumbers
        With `start`, or None comes back.
    kept : sequence of bool
        Own numbers that the record determines.
    inner : ndarray of bool
        Free parameters that are not at a bound.
    joint : ndarray
        Covariance of those parameters and the determined own numbers.

    Returns
    -------
    ndarray, shape (n_states,), or None
        NaN where a number that it depends on is not determined.
    """
    if numbers.start is None:
        return None
    slopes = numbers.start[1]
    n_free = len(inner)
    n_moving = slopes.shape[1] - n_free
    seen = np.array(kept[:n_moving], dtype=bool)
    if not np.all(seen):
        return np.full(len(slopes), np.nan)
    shared, own = slopes[:, :n_free][:, inner], slopes[:, n_free:]
    biases = np.zeros((len(slopes), joint.shape[0] - shared.shape[1] - n_moving))
    whole = np.hstack([shared, own, biases])
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", whole, joint, whole)))


def freedom_of(
    blocks: Sequence[Block],
    models: Sequence[Autoregression],
    triangle: Array,
    beside: Array | None = None,
) -> Array:
    """Degrees of freedom of each variance: noise models are themselves estimates."""
    plain = information_inverse(triangle)
    n_outputs = blocks[0].residual.shape[0]
    variances = np.zeros((n_outputs, len(plain)))
    for block in blocks:
        parts = (block.projected @ plain).reshape(n_outputs, -1, len(plain))
        for output, (model, part) in enumerate(zip(models, parts, strict=True)):
            product = toeplitz_product(model.autocovariance(len(part)), part)
            variances[output] += np.einsum("nk,nk->k", part, product)
    doubt = sum(
        variance**2 / model.freedom() for variance, model in zip(variances, models, strict=True)
    )
    total = variances.sum(axis=0) + np.diag(_share_beside(plain, beside))
    # Errors that are known leave no doubt, nor does a residual that vanishes.
    known = doubt > 0.0
    return np.where(known, total**2 / np.where(known, doubt, 1.0), np.inf)


def _own_numbers(
    fitted: Model,
    prepared: RecordSet,
    numbers: OwnNumbers,
    kept: Sequence[bool],
    covariance: Array,
    of_start: Array | None,
) -> Own:
    errors = np.full(numbers.n_free, np.nan)
    errors[np.array(kept, dtype=bool)] = np.sqrt(np.diag(covariance))
    initial = numbers.initial
    if numbers.start is not None and of_start is not None:
        initial = numbers.start[0]
        errors[: len(initial)] = of_start
    units = dict(fitted.states) if isinstance(fitted, StateSpaceModel) else {}
    kinds = (
        (prepared.states, initial, numbers.free_initial, units),
        (fitted.inputs, numbers.shift, numbers.free_shift, fitted.units),
        (fitted.outputs, numbers.bias, numbers.free_bias, fitted.units),
    )
    found, start = [], 0
    for names, values, places, known in kinds:
        part = {}
        for place, name in enumerate(names):
            value, unit = float(values[place]), known.get(name, "1")
            if place not in places:
                part[name] = FittedParameter(name, unit, value, "fixed", reason="fixed")
                continue
            error = float(errors[start + places.index(place)])
            if np.isnan(error):
                part[name] = FittedParameter(name, unit, value, "free", reason=UNDETERMINED)
            else:
                interval = interval95(value, error)
                part[name] = FittedParameter(name, unit, value, "free", error, interval)
        start += len(places)
        found.append(part)
    return found[0], found[2], found[1]
