"""What a correction of the estimator's bias does to the errors of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.identification.frequency_domain.bias_rounds import BiasRounds
from flightid.identification.frequency_domain.error_model import ErrorModel, error_model
from flightid.identification.frequency_domain.estimator_bias import Correction
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.models import GreyBoxModel
from flightid.responses import FrequencyResponse

Array = NDArray[np.float64]

NEGLIGIBLE_CONTRACTION = 0.05
"""Contraction of the rounds of correction at which a correction hardly follows the parameters."""
DIFFERENCE = 1e-4
"""Relative change of a parameter for derivatives of corrected points."""


def errors_after(
    done: BiasRounds, correction: Correction, selected: Sequence[SelectedResponse]
) -> ErrorModel | None:
    """Errors of the corrected points, their noise being what the model leaves of the outputs.

    Parameters
    ----------
    done : BiasRounds
    correction : Correction
    selected : sequence of SelectedResponse
        Corrected points.

    Returns
    -------
    ErrorModel or None
        None where the errors stand as they were.
    """
    found = correction.errors(done.model)
    return None if found is None else error_model(replace(done.data, errors=found), selected)


def points_follow(
    done: BiasRounds,
    fitted: GreyBoxModel,
    correction: Correction,
    selected: Sequence[SelectedResponse],
    errors: ErrorModel,
) -> Array | None:
    """Derivatives of the corrected points by the free parameters, by differences.

    A corrected response follows the model that corrects it, so that the rounds end further from
    the truth than one fit of fixed data would.

    Parameters
    ----------
    done : BiasRounds
    fitted : GreyBoxModel
        After the last fit.
    correction : Correction
    selected : sequence of SelectedResponse
    errors : ErrorModel

    Returns
    -------
    ndarray, shape (n_points, n_free), or None
        Rows as the error model's: of each run all real parts, then all imaginary. None where the
        rounds ended at once, so that the points hardly follow, or the errors are not known.
    """
    if not errors.runs or done.contraction <= NEGLIGIBLE_CONTRACTION:
        return None
    here = _points(selected, correction.apply(fitted), errors)
    columns = []
    for parameter in fitted.parameters.free:
        value = parameter.value or 0.0
        step = DIFFERENCE * (abs(value) or 1.0)
        if value + step > parameter.maximum:
            step = -step
        moved = fitted.with_values({parameter.name: value + step})
        there = _points(selected, correction.apply(moved), errors)
        columns.append((there - here) / step)
    return np.column_stack(columns)


def _points(
    selected: Sequence[SelectedResponse], corrected: FrequencyResponse, errors: ErrorModel
) -> Array:
    parts = []
    for run in errors.runs:
        group = selected[run.first : run.first + run.count]
        joined = np.concatenate(
            [
                corrected.pair(each.measured.output, each.measured.input).response[each.places]
                for each in group
            ]
        )
        parts += [joined.real, joined.imag]
    return np.concatenate(parts)
