"""Covariance of coefficients whose equation has no model of the noise.

Output error and finite impulse responses leave in their residuals whatever the noise is; the
inverse information would take it for white. (A, C and D are noise models: where a structure has
one, its errors are white or the structure is wrong, which the residual tests tell.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import ResidualCovariance, residual_covariance

Array = NDArray[np.float64]
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
    """Covariance of the coefficients of B and F by the colour of the errors.

    Parameters
    ----------
    structure : PolynomialStructure
        Without noise model.
    data : SampledChannels
    theta : ndarray, shape (n_coefficients,)
        Estimates, B of all inputs before F of all inputs.
    errors : ndarray, shape (n_samples,)
        Measured minus modelled, records after records.
    skip : int
        First errors of each record that the fit left out.

    Assumes
    -------
    Stationary noise, independent of the inputs.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., eqs. 9.41 and 9.42 (errors that are not white).
    """
    size = float(np.sqrt(errors @ errors / errors.size)) or 1.0
    blocks = []
    for span in data.spans:
        level = np.ones((errors[span].size, int(data.levels)))
        shared, own = _sensitivities(
            structure, theta, data.inputs[:, span], data.output[span] - errors[span], level
        )
        if structure.past != "estimate" or skip:
            own = level
        blocks.append(
            RecordBlock.of(
                shared[None, skip:] / size, own[None, skip:], errors[None, span][:, skip:] / size
            )
        )
    inputs = [data.inputs[:, span][:, skip:] for span in data.spans]
    return residual_covariance(blocks, inputs=inputs)


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
        driven.append(scipy.signal.lfilter(b, f, row))
        reach = min(max(b.size - 1, f.size - 1), n)
        impulses = np.zeros((n, reach))
        impulses[np.arange(reach), np.arange(reach)] = 1.0
        starts.append(scipy.signal.lfilter([1.0], f, impulses, axis=0))
    own = np.concatenate([*starts, level], axis=1)
    shares = np.linalg.lstsq(own, modelled - np.sum(driven, axis=0), rcond=INDEPENDENT)[0]
    of_b, turned, first = [], [], 0
    for i, (row, b, f) in enumerate(zip(inputs, numerators, denominators, strict=True)):
        whole = driven[i] + starts[i] @ shares[first : first + starts[i].shape[1]]
        first += starts[i].shape[1]
        moved = scipy.signal.lfilter([1.0], f, row)
        of_b += [_late(moved, lag) for lag in range(structure.nk[i], b.size)]
        turned.append(scipy.signal.lfilter([1.0], f, whole))
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
