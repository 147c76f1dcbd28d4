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

from flightid.identification.frequency_domain.estimates import (
    at_bound,
    fitted_parameters,
    require_identifiable,
)
from flightid.identification.records.setup import OwnNumbers, RecordSet
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.uncertainty import correlation as correlation_of
from flightid.uncertainty.coloured_residuals import (
    Autoregression,
    Taken,
    noise_models,
)
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
Own = tuple[dict[str, Estimate], dict[str, Estimate], dict[str, Estimate]]
UNDETERMINED = "the record does not tell it apart from the others of its own numbers"
AT_BOUND = "at bound: the record would move it further"
_ROUNDING = 1e-9


@dataclass(frozen=True)
class RecordStatistics:
    """What is known of the estimates.

    Attributes
    ----------
    parameters : mapping of str to Estimate
    names : tuple of str
        Order of `covariance` and `correlation`.
    covariance, correlation : ndarray
        The first corrected for coloured residuals, the second of the plain information.
    own : list of tuple
        Initial state, biases, reference shifts of each record.
    inflation : float
        Largest ratio of a corrected standard error to that for white residuals.
    """

    parameters: Mapping[str, Estimate]
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


@dataclass(frozen=True)
class Beside:
    """Residuals of unit variance, fitted together with the records, and what they answer to.

    Attributes
    ----------
    slopes : ndarray, shape (n_residuals, n_free)
        Derivatives by the free parameters, the data being as they are.
    total : ndarray, shape (n_residuals, n_free)
        The same with data that follow the parameters, as corrected points do.
    """

    slopes: Array
    total: Array

    def of(self, parameters: NDArray[np.bool_]) -> Beside:
        """Columns of some parameters."""
        return Beside(self.slopes[:, parameters], self.total[:, parameters])


def record_statistics(
    fitted: GreyBoxModel,
    prepared: RecordSet,
    own: Sequence[OwnNumbers],
    determined: Sequence[Sequence[bool]],
    runs: Sequence[tuple[Array, Array]],
    noise: Array,
    limit: float,
    beside: Beside | None = None,
) -> RecordStatistics:
    """Standard errors, bounds and correlations of a fit to records.

    `beside` concerns residuals of other data that were fitted together with the records.

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
    other = None if beside is None else beside.of(inner)
    triangle = triangle_of(blocks, None if other is None else other.slopes)
    require_identifiable(names, triangle)
    covariance, own_covariances, crossed, freedom = covariances(blocks, triangle, other)
    plain = information_inverse(triangle)
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
    root = _inverse_root(triangle)
    return np.asarray(root @ root.T)


def _inverse_root(triangle: Array) -> Array:
    """R⁻¹."""
    size = np.linalg.norm(triangle, axis=0)
    return np.asarray(solve_triangular(triangle / size, np.eye(len(size))) / size[:, None])


def _answers(models: Sequence[Autoregression], block: Block) -> Array:
    """[basis, projected]ᵀ Ω [basis, projected] for the noise of each output of one record."""
    directions = np.hstack([block.basis, block.projected])
    parts = directions.reshape(len(models), -1, directions.shape[1])
    return np.array(
        [part.T @ model.product(part) for model, part in zip(models, parts, strict=True)]
    )


def _gain(root: Array, beside: Beside | None) -> Array:
    """What turns a gradient into a change of the estimates, from the root R⁻¹ of the information.

    Where data follow the parameters, the equations that the estimates solve bend less than the
    cost does, and the gain is larger than the inverse of the information.
    """
    if beside is None:
        return np.asarray(root @ root.T)
    follows = (beside.slopes @ root).T @ ((beside.slopes - beside.total) @ root)
    return np.asarray(root @ np.linalg.solve(np.eye(len(root)) - follows, root.T))


def covariances(
    blocks: Sequence[Block], triangle: Array, beside: Beside | None = None
) -> tuple[Array, list[Array], list[Array], Array]:
    """Covariance of the shared parameters, of each record's own, between the two.

    Parameters
    ----------
    blocks : sequence of Block
    triangle : ndarray, shape (n, n)
        Of the sensitivities of all records together, and of what is fitted beside them.
    beside : Beside, optional
        Residuals beside the records.

    Returns
    -------
    shared : ndarray, shape (n, n)
    own, crossed : list of ndarray
        By record, shapes (n_own, n_own) and (n_own, n).
    freedom : ndarray, shape (n,)
        Degrees of freedom of each shared variance: noise models are themselves estimates.
    """
    root = _inverse_root(triangle)
    turned = _gain(root, beside)
    taken = []
    for block in blocks:
        parts = (block.basis, block.projected @ root)
        taken.append(Taken(*(part.reshape(*block.residual.shape, -1) for part in parts)))
    models = noise_models([block.residual for block in blocks], taken)
    answers = [_answers(models, block) for block in blocks]
    sizes = [block.basis.shape[1] for block in blocks]
    heard = sum(each[:, m:, m:] for each, m in zip(answers, sizes, strict=True))
    variances = turned @ heard @ turned.T
    shared = np.asarray(variances.sum(axis=0))
    if beside is not None:
        brought = beside.slopes @ turned.T
        shared = shared + brought.T @ brought
    own, crossed = [], []
    for block, each, m in zip(blocks, answers, sizes, strict=True):
        # Own numbers answer the record's own noise and, through the parameters, everybody's.
        noise = each.sum(axis=0)
        back = np.linalg.inv(block.triangle)
        through = back @ block.shared_on_own
        gain = np.vstack([np.zeros((m, len(turned))), turned.T])
        direct = np.vstack([back.T, -turned.T @ through.T])
        others = shared - gain.T @ noise @ gain
        own.append(_lifted(direct.T @ noise @ direct + through @ others @ through.T, back @ back.T))
        crossed.append(direct.T @ noise @ gain - through @ others)
    diagonals = np.diagonal(variances, axis1=1, axis2=2)
    doubt = sum(
        variance**2 / model.freedom() for variance, model in zip(diagonals, models, strict=True)
    )
    # Errors that are known leave no doubt, nor does a residual that vanishes.
    doubtful = doubt > 0.0
    freedom = np.where(doubtful, np.diag(shared) ** 2 / np.where(doubtful, doubt, 1.0), np.inf)
    return _lifted(shared, information_inverse(triangle)), own, crossed, np.asarray(freedom)


def _lifted(covariance: Array, plain: Array) -> Array:
    """Of data without noise, rounding alone is left, and that may be negative."""
    lift = np.maximum(_ROUNDING * np.diag(plain) - np.diag(covariance), 0.0)
    return np.asarray(covariance + np.diag(lift))


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


def _own_numbers(
    fitted: GreyBoxModel,
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
                part[name] = Estimate(name, value, unit, None, "fixed", status="fixed")
                continue
            number = start + places.index(place)
            error = float(errors[number])
            if np.isnan(error) and numbers.limits and value in numbers.limits[number]:
                part[name] = Estimate(name, value, unit, None, AT_BOUND, status="at bound")
            elif np.isnan(error):
                part[name] = Estimate(name, value, unit, None, UNDETERMINED, status="free")
            else:
                part[name] = Estimate(name, value, unit, error, status="free")
        start += len(places)
        found.append(part)
    return found[0], found[2], found[1]
