"""Errors of a fitted model narrower than its response resolves: what long windows tell alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flightid.identification.fitted_response import FittedResponse
from flightid.identification.frequency_domain.estimator_bias import OUTSIDE, Correction
from flightid.models import GreyBoxModel


def with_narrow_residuals(
    responses: Sequence[FittedResponse], correction: Correction, fitted: GreyBoxModel
) -> tuple[FittedResponse, ...]:
    """Responses that know what each window length makes of what the model leaves.

    Parameters
    ----------
    responses : sequence of FittedResponse
    correction : Correction
        Of the response that they belong to, as it was measured.
    fitted : GreyBoxModel
        With the estimates.

    Returns
    -------
    tuple of FittedResponse
        As they were where the weights of the estimate are not known.
    """
    data = correction.data
    bands = [each.band_rad_s for each in responses]
    if data.linear is None or not bands:
        return tuple(responses)
    band = min(low for low, _ in bands), max(high for _, high in bands)
    try:
        found = correction.left_by_window(fitted, band)
    except OUTSIDE:
        return tuple(responses)
    made = []
    for each in responses:
        row = data.outputs.index(each.measured.output)
        column = data.inputs.index(each.measured.input)
        model, omega = each.model, each.measured.omega_rad_s
        known = [one.relative(row, column, model, omega) for one in found if np.all(model != 0.0)]
        made.append(replace(each, narrow=tuple(known)))
    return tuple(made)
