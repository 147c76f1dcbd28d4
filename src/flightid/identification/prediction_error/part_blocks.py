"""Errors of a polynomial model and how they answer to its coefficients, record by record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

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
    return _run(structure, data, memory, theta)[0]


def _run(
    structure: PolynomialStructure, data: SampledChannels, memory: list[list[float]], theta: Array
) -> tuple[Array, list[float]]:
    return _native.polynomial_errors(
        data.output,
        data.inputs,
        list(data.lengths),
        structure.native,
        theta,
        BEFORE[structure.past],
        memory,
        data.levels,
    )


def about_levels(
    structure: PolynomialStructure, data: SampledChannels, memory: list[list[float]], theta: Array
) -> SampledChannels:
    """The channels about a point on the model's steady line, in place of their means.

    The constant of A y = Σ B/F u + C/D e moves the output's offset; where it would leave the range
    that the record shows, as of an integrator that an input's offset drives, it moves the inputs'.
    """
    if not data.levels:
        return data
    _, constants = _run(structure, data, memory, theta)
    parts = np.split(theta, np.cumsum(structure.counts)[:-1])
    m = len(structure.inputs)
    noise, steady = 1.0 + parts[m + 2].sum(), 1.0 + parts[0].sum()
    below = np.array([1.0 + each.sum() for each in parts[m + 3 :]])
    slopes = np.array([b.sum() for b in parts[1 : m + 1]]) / below
    output, inputs, offsets = data.output.copy(), data.inputs.copy(), []
    for span, constant, before in zip(data.spans, constants, data.offsets, strict=True):
        reach, moved = float(np.ptp(output[span])), np.zeros(m)
        level = constant / (noise * steady) if noise * steady else np.inf
        if abs(level) > reach:
            level = 0.0
            weights = slopes * np.var(inputs[:, span], axis=1)
            if structure.nd == 0 and weights @ slopes > 0.0:
                moved = -constant / (weights @ slopes) * weights
        output[span] -= level
        inputs[:, span] -= moved[:, None]
        moves = {structure.output: level, **dict(zip(structure.inputs, moved, strict=True))}
        offsets.append({name: value + float(moves[name]) for name, value in before.items()})
    return replace(data, output=output, inputs=inputs, offsets=tuple(offsets))


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
