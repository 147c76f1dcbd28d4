"""How well a time-domain fit knows its numbers: intervals that allow for coloured residuals.

Residuals are whitened across outputs by R. Each record's own numbers are taken out of the
sensitivities by orthogonal projection, so the parameters that all records share meet in one small
information matrix. The noise of each whitened output gets an autoregressive model whose
autocovariance replaces "white" in the covariance of the estimates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.frequency_domain.estimates import (
    at_bound,
    fitted_parameters,
    require_identifiable,
)
from flightid.identification.records.setup import OwnNumbers, RecordSet
from flightid.identification.rival_fits import judged
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.uncertainty import correlation as correlation_of
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.blocks import JointResiduals, RecordBlock
from flightid.uncertainty.coloured_residuals import residual_covariance, triangle_of
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.fitted_correlation import FittedCorrelation
from flightid.uncertainty.residual_colour import Colour

Array = NDArray[np.float64]
Own = tuple[dict[str, Estimate], dict[str, Estimate], dict[str, Estimate]]
UNDETERMINED = "the record does not tell it apart from the others of its own numbers"
AT_ONCE = 4096
"""Samples that are whitened together: they stay in the cache."""
AT_BOUND = "at bound: the record would move it further"


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
    colour : Colour
        Ratios of standard errors to those for white residuals, and for noise of one power.
    agreement : Agreement
        Of records and of their halves.
    bias : ndarray, shape (n,), or None
        Of the estimates, by what was fitted beside the records; the covariance holds its square.
    correlations : tuple of FittedCorrelation
        Of inputs with residuals.
    """

    parameters: Mapping[str, Estimate]
    names: tuple[str, ...]
    covariance: Array
    correlation: Array
    own: list[Own]
    colour: Colour
    agreement: Agreement
    bias: Array | None = None
    correlations: tuple[FittedCorrelation, ...] = ()


@dataclass(frozen=True, eq=False)
class HeldStart:
    """Initial states that one record holds at their measurement.

    Attributes
    ----------
    slopes : ndarray, shape (n_outputs, n_samples, n_held)
        Derivatives of the outputs by them.
    covariance : ndarray, shape (n_held, n_held)
        Of the measurement's noise.
    """

    slopes: Array
    covariance: Array


def record_statistics(
    fitted: GreyBoxModel,
    prepared: RecordSet,
    own: Sequence[OwnNumbers],
    determined: Sequence[Sequence[bool]],
    runs: Iterable[tuple[Array, Array]],
    noise: Array,
    limit: float,
    beside: JointResiduals | None = None,
    starts: Sequence[HeldStart | None] = (),
) -> RecordStatistics:
    """Standard errors, bounds and correlations of a fit to records.

    `beside` concerns residuals of other data that were fitted together with the records, `starts`
    initial states that were held at a measurement: its noise adds to the covariance. The slopes of
    `runs` are lost: what is made of them takes their memory.

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
        residual = _limited(whitener @ (measured - outputs), limit)
        shared, rest = np.split(_whitened(whitener, slopes), [len(free)], axis=2)
        own_slopes = _kept(rest, np.array(kept))
        blocks.append(RecordBlock.of(_kept(shared, inner), own_slopes, residual, overwrite=True))
        del slopes, shared, rest, own_slopes  # of which blocks hold what they need
    other = None if beside is None else beside.of(inner)
    triangle = triangle_of(blocks, None if other is None else other.slopes)
    require_identifiable(names, triangle)
    inputs = [each[0] for each in prepared.arrays] if judged() else None
    held = _of_starts(starts, blocks, whitener)
    known = residual_covariance(
        blocks, other, inputs=inputs, coloured=judged(), overwrite=True, triangle=triangle
    )
    covariance = known.covariance + known.white @ held @ known.white.T
    moved = None
    if other is not None and other.bias is not None:
        moved = np.asarray(known.white @ (other.slopes.T @ other.bias))
        covariance = covariance + np.outer(moved, moved)
    parameters = fitted_parameters(
        fitted, names, covariance, triangle / np.sqrt(2.0), known.freedom
    )
    return RecordStatistics(
        parameters,
        names,
        covariance,
        correlation_of(known.white) if names else np.zeros((0, 0)),
        [
            _own_numbers(
                fitted, prepared, numbers, kept, found, start_errors(numbers, kept, inner, joint)
            )
            for numbers, kept, found, joint in zip(
                own,
                determined,
                known.own,
                (
                    np.block([[covariance, cross.T], [cross, each]])
                    for cross, each in zip(known.crossed, known.own, strict=True)
                ),
                strict=True,
            )
        ],
        known.colour,
        known.agreement,
        moved,
        known.correlations,
    )


def _of_starts(
    starts: Sequence[HeldStart | None],
    blocks: Sequence[RecordBlock],
    whitener: Array,
) -> Array:
    """What the noise of measured initial states adds to the covariance of the scores."""
    count = blocks[0].projected.shape[1]
    total = np.zeros((count, count))
    for start, block in zip(starts, blocks, strict=False):
        if start is None:
            continue
        white = np.tensordot(whitener, start.slopes, axes=1)
        moved = block.projected.T @ white.reshape(len(block.projected), -1)
        total += moved @ start.covariance @ moved.T
    return total


def _whitened(whitener: Array, slopes: Array) -> Array:
    """Slopes (n_outputs, n_samples, k) whitened across outputs, in place."""
    own = np.diag(whitener)
    if np.array_equal(whitener, np.diag(own)):
        slopes *= own[:, None, None]
        return slopes
    for begin in range(0, slopes.shape[1], AT_ONCE):
        here = slopes[:, begin : begin + AT_ONCE]
        here[:] = np.tensordot(whitener, here, axes=1)
    return slopes


def _kept(slopes: Array, places: NDArray[np.bool_]) -> Array:
    """Some columns."""
    if np.all(places):
        return slopes  # no copy: long records are large
    return slopes[:, :, places.astype(bool)]


def _limited(residual: Array, limit: float) -> Array:
    """What an estimate with a limited loss feels of whitened residuals (Huber 1981, eq. 7.6.6)."""
    if np.isinf(limit):
        return residual
    inside = np.mean(np.abs(residual) <= limit, axis=1, keepdims=True)
    return np.asarray(np.clip(residual, -limit, limit) / inside)


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
