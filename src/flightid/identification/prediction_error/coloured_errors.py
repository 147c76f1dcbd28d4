"""Covariance of coefficients whose equation has no model of the noise.

Output error and finite impulse responses leave in their residuals whatever the noise is; the
inverse information would take it for white. (A, C and D are noise models: where a structure has
one, its errors are white or the structure is wrong, which the residual tests tell.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.recursive_filter import filtered
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import (
    ResidualCovariance,
    residual_covariance,
    triangle_of,
)

Array = NDArray[np.float64]
STEP = 1e-4
"""Of a coefficient of C or D, for differences of determinants."""
INDEPENDENT = 1e-9
"""Share of the largest singular value below which a start's direction is another's."""


def has_noise_model(structure: PolynomialStructure) -> bool:
    """Whether A, C or D shapes the noise.

    Example
    -------
    >>> from flightid.models import PolynomialModel
    >>> has_noise_model(PolynomialModel.oe("y", "u", nb=1, nf=2))
    False
    """
    return bool(structure.na or structure.nc or structure.nd)


def output_error_covariance(
    structure: PolynomialStructure,
    data: SampledChannels,
    theta: Array,
    errors: Array,
    skip: int,
) -> ResidualCovariance:
    """Covariance of the coefficients of B and F by the colour of what they leave of the output.

    Where C and D model that noise, the fit weighs by their inverse: instruments. What it took of
    the noise is given back, for a noise model that was fitted to the rest is too small where
    inputs are slow: an AR(1) of 0.9 beside four steps in 600 samples ends at 0.885.

    Parameters
    ----------
    structure : PolynomialStructure
        Without A.
    data : SampledChannels
    theta : ndarray, shape (n_coefficients,)
        Estimates, in the order of `structure.names`.
    errors : ndarray, shape (n_samples,)
        One step ahead, records after records; without noise model measured minus modelled.
    skip : int
        First errors of each record that the fit left out.

    Assumes
    -------
    Stationary noise, independent of the inputs.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., eqs. 9.41 and 9.42 (errors that are not white);
    Patterson & Thompson (1971), Biometrika 58(3), 545-554 (what a fit takes of its noise).
    """
    own_of_noise = structure.nc + structure.nd
    blocks = []
    for shared, own, rest in answers(structure, data, theta, errors, skip):
        block = RecordBlock.of(shared[None], own[None], rest[None])
        if own_of_noise:
            weighed = _weighed(structure, theta, shared, own, skip)
            turned = filtered(*noise_filter(structure, theta), weighed[::-1], axis=0)
            block = RecordBlock.of(turned[None, ::-1], own[None], rest[None])
            block = replace(block, answering=shared)
        blocks.append(block)
    inputs = [data.inputs[:, span][:, skip:] for span in data.spans]
    return residual_covariance(blocks, inputs=None if own_of_noise else inputs)


def answers(
    structure: PolynomialStructure, data: SampledChannels, theta: Array, errors: Array, skip: int
) -> list[tuple[Array, Array, Array]]:
    """How outputs answer to B and F and to a record's own numbers, and what is left of them.

    By record; the noise is of unit variance.
    """
    above, below = noise_filter(structure, theta)[::-1]
    of_vehicle = theta[[name[0] in "bf" for name in structure.names]]
    left = [filtered(above, below, errors[span]) for span in data.spans]
    size = float(np.sqrt(np.mean(np.concatenate(left) ** 2))) or 1.0
    found = []
    for span, rest in zip(data.spans, left, strict=True):
        level = np.ones((rest.size, int(data.levels)))
        shared, own = _sensitivities(
            structure, of_vehicle, data.inputs[:, span], data.output[span] - rest, level
        )
        if structure.past != "estimate" or skip:
            own = level
        found.append((shared[skip:] / size, own[skip:], rest[skip:] / size))
    return found


def noise_bias(
    structure: PolynomialStructure,
    theta: Array,
    columns: Sequence[tuple[Array, Array, Array]],
    covariance: Array,
) -> Array:
    """How far C and D lie from those of the whole noise, for what the fit took of it.

    Half the slope of ln det XᵀΩ⁻¹X, by which the restricted likelihood differs from the plain one.

    Parameters
    ----------
    structure : PolynomialStructure
    theta : ndarray, shape (n_coefficients,)
    columns : sequence of tuple of ndarray
        Of `answers`.
    covariance : ndarray, shape (nc + nd, nc + nd)
        Of C and D by the plain likelihood.

    Reference
    ---------
    Patterson & Thompson (1971), Biometrika 58(3), 545-554.
    """
    places = np.flatnonzero([name[0] in "cd" for name in structure.names])
    slopes = []
    for place in places:
        sizes = []
        for step in (-STEP, STEP):
            moved = theta.copy()
            moved[place] += step
            blocks = [_whitened(structure, moved, *each[:2]) for each in columns]
            triangles = [triangle_of(blocks), *(block.triangle for block in blocks)]
            sizes.append(sum(np.log(np.abs(np.diag(each))).sum() for each in triangles))
        slopes.append((sizes[1] - sizes[0]) / (2.0 * STEP))
    return np.asarray(covariance @ np.array(slopes))


def _whitened(
    structure: PolynomialStructure, theta: Array, shared: Array, own: Array
) -> RecordBlock:
    """Sensitivities through D/C from rest.

    All samples count: beyond the reach of F a start is an impulse for each of the first samples,
    and what D/C leaves of several behind the reach of D is one direction, C's own.
    """
    shared, own = (
        filtered(*noise_filter(structure, theta), part, axis=0) for part in (shared, own)
    )
    return RecordBlock.of(shared[None], own[None], np.zeros((1, len(shared))))


def _weighed(
    structure: PolynomialStructure, theta: Array, shared: Array, own: Array, skip: int
) -> Array:
    """Sensitivities through D/C as the fit weighs them: what noise was before a record is fitted.

    Its values add to the first samples before 1/C and take their weight, which told where a record
    started: from rest, bars of a slow rig that is switched on were 30 to 40 % short.
    """
    whitened = _whitened(structure, theta, shared, own)
    count = 0
    if structure.past == "estimate" and not skip:
        count = min(_native.polynomial_memory(structure.native)[1], len(shared))
    if not count:
        return whitened.projected
    impulses = np.eye(len(shared), count)
    before = filtered([1.0], noise_filter(structure, theta)[1], impulses, axis=0)
    taken = _independent(np.hstack([whitened.basis, before]))
    return np.asarray(whitened.projected - taken @ (taken.T @ whitened.projected))


def noise_filter(structure: PolynomialStructure, theta: Array) -> tuple[Array, Array]:
    """D over C, which makes the noise white, with their leading ones."""
    parts = [[x for x, n in zip(theta, structure.names, strict=True) if n[0] == k] for k in "dc"]
    return np.array([1.0, *parts[0]]), np.array([1.0, *parts[1]])


def _sensitivities(
    structure: PolynomialStructure, theta: Array, inputs: Array, modelled: Array, level: Array
) -> tuple[Array, Array]:
    """Derivatives of the output by the coefficients; directions of what was before and of levels.

    ŷᵢ = Bᵢ/Fᵢ uᵢ: ∂ŷᵢ/∂b_k = q⁻ᵏ/Fᵢ uᵢ and ∂ŷᵢ/∂f_k = −q⁻ᵏ/Fᵢ ŷᵢ, summed over the inputs of one F.
    What was before a record runs out as impulses through 1/Fᵢ; each ŷᵢ holds its part of that.
    """
    n = modelled.size
    numerators, denominators = _polynomials(structure, theta)
    driven, starts = [], []
    for row, b, f in zip(inputs, numerators, denominators, strict=True):
        driven.append(filtered(b, f, row))
        reach = min(max(b.size - 1, f.size - 1), n)
        impulses = np.zeros((n, reach))
        impulses[np.arange(reach), np.arange(reach)] = 1.0
        starts.append(filtered([1.0], f, impulses, axis=0))
    own = np.concatenate([*starts, level], axis=1)
    shares = np.linalg.lstsq(own, modelled - np.sum(driven, axis=0), rcond=INDEPENDENT)[0]
    of_b, turned, first = [], [], 0
    for i, (row, b, f) in enumerate(zip(inputs, numerators, denominators, strict=True)):
        whole = driven[i] + starts[i] @ shares[first : first + starts[i].shape[1]]
        first += starts[i].shape[1]
        moved = filtered([1.0], f, row)
        of_b += [_late(moved, lag) for lag in range(structure.nk[i], b.size)]
        turned.append(filtered([1.0], f, whole))
    if structure.is_common:
        turned = [np.sum(turned, axis=0)]
    degrees = structure.degrees_of_f
    of_f = [
        -_late(row, lag)
        for row, degree in zip(turned, degrees, strict=True)
        for lag in range(1, degree + 1)
    ]
    return np.array([*of_b, *of_f]).T, _independent(own)


def _polynomials(structure: PolynomialStructure, theta: Array) -> tuple[list[Array], list[Array]]:
    """B with its delay and F with its leading one, by input."""
    m = len(structure.nb)
    parts = np.split(theta, np.cumsum([*structure.nb, *structure.degrees_of_f])[:-1])
    below = [np.concatenate([[1.0], f]) for f in parts[m:]]
    return (
        [np.concatenate([np.zeros(k), b]) for k, b in zip(structure.nk, parts[:m], strict=True)],
        below * m if structure.is_common else below,
    )


def _late(row: Array, lag: int) -> Array:
    """A row that comes some samples later, from rest."""
    return np.concatenate([np.zeros(min(lag, row.size)), row[: max(row.size - lag, 0)]])


def _independent(columns: Array) -> Array:
    """Orthonormal directions that columns span: inputs with one F in common share theirs."""
    if not columns.shape[1]:
        return columns
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, sizes > INDEPENDENT * sizes[0]])


def instrumental_covariance(
    instruments: Sequence[Array], regressors: Sequence[Array], errors: Sequence[Array]
) -> ResidualCovariance:
    """Covariance of coefficients by instruments, by the colour of what the equation leaves.

    Parameters
    ----------
    instruments, regressors : sequence of ndarray, shape (n_samples, n)
        By record.
    errors : sequence of ndarray, shape (n_samples,)

    Reference
    ---------
    Söderström & Stoica, *System Identification*, eq. 8.30.
    """
    total = np.concatenate(list(errors))
    size = float(np.sqrt(total @ total / total.size)) or 1.0
    blocks = [
        RecordBlock.of(each[None] / size, np.zeros((1, len(each), 0)), error[None] / size)
        for each, error in zip(instruments, errors, strict=True)
    ]
    return residual_covariance(
        [
            replace(block, answering=each / size)
            for block, each in zip(blocks, regressors, strict=True)
        ]
    )
