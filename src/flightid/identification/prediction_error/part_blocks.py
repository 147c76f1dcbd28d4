"""Errors of a polynomial model and how they answer to its coefficients, record by record."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.uncertainty.blocks import RecordBlock

Array = NDArray[np.float64]
BEFORE = {"estimate": "unknown", "zero": "rest", "backcast": "given"}
STEP = 1e-6
"""Share of a coefficient, or of one, for differences of errors that bend little."""


def errors_at(
    structure: PolynomialStructure, data: SampledChannels, memory: list[list[float]], theta: Array
) -> Array:
    """Errors one step ahead of all samples, records after records.

    `memory` is the past of each record where it was given.
    """
    return np.asarray(
        _native.polynomial_errors(
            data.output,
            data.inputs,
            list(data.lengths),
            structure.native,
            theta,
            BEFORE[structure.past],
            memory,
        )
    )


def part_blocks(
    at: Callable[[Array], Array], data: SampledChannels, theta: Array, skip: int
) -> list[RecordBlock]:
    """Blocks of unit variance, by differences: whatever the structure, its start included.

    Parameters
    ----------
    at : callable
        Errors one step ahead of all samples, by the coefficients.
    data : SampledChannels
    theta : ndarray, shape (n,)
        Estimates.
    skip : int
        First errors of each record that the fit left out.

    Returns
    -------
    list of RecordBlock
        By record.
    """
    errors = at(theta)
    slopes = np.empty((errors.size, theta.size))
    for place, value in enumerate(theta):
        moved = theta.copy()
        moved[place] += STEP * max(abs(value), 1.0)
        slopes[:, place] = (errors - at(moved)) / (moved[place] - value)
    size = float(np.sqrt(errors @ errors / errors.size)) or 1.0
    return [
        RecordBlock.of(
            slopes[None, span][:, skip:] / size,
            np.zeros((1, slopes[span][skip:].shape[0], 0)),
            errors[None, span][:, skip:] / size,
        )
        for span in data.spans
    ]
