"""What a response's estimator makes of a model: the leakage and finite resolution that it adds.

An estimate is linear in the outputs, Ĥ = L[y]. For a model that gives y* on the measured inputs the
estimator's bias is L[y*] − H, and the estimate without it is H + L[y − y*]: no error where the
model is right, whatever the windows. The model that this needs comes from the fit, in rounds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, ModelError
from flightid.identification.model_outputs import (
    PairSystem,
    driven_output,
    free_outputs,
    pair_systems,
)
from flightid.models import Model, TransferFunctionModel
from flightid.responses import FrequencyResponse
from flightid.responses.linear_estimate import LinearEstimate

Array = NDArray[np.float64]

LARGEST_GROWTH = 7.0
"""Largest growth exponent over a record that an unstable model may have: a factor of a thousand."""
LARGEST_RESIDUAL = 10.0
"""Largest residual, in multiples of the measured output's rms, before a simulation is not believed:
a loop may hold an output well below its disturbances, but no model that is right diverges so."""
_RANK = 1e-9


def why_unknown(data: FrequencyResponse) -> str:
    """Why the weights of a response's estimator are not known; empty where they are.

    Parameters
    ----------
    data : FrequencyResponse

    Returns
    -------
    str
    """
    if data.linear is not None:
        return ""
    if data.method.endswith("arithmetic"):
        return "the response is a result of arithmetic"
    if data.method == "given":
        return "the response was given as values"
    return "the response was read from a file or estimated with covariance=False"


def remove_bias(model: Model, data: FrequencyResponse, hold: str) -> FrequencyResponse:
    """The measured response without the bias that its estimator has for this model.

    Unknown initial states and trims of each record are fitted to its outputs, so that a record may
    begin in motion. Coherence and covariance stay; responses that the model lacks stay.

    Parameters
    ----------
    model : Model
    data : FrequencyResponse
        Estimated from records, with `linear`.
    hold : {"band_limited", "first", "zero"}
        What the inputs do between their samples.

    Returns
    -------
    FrequencyResponse

    Raises
    ------
    ModelError
        More zeros than poles, or a negative delay.
    DataError
        The weights are not known, or the model diverges on the records.
    """
    linear = data.linear
    if linear is None:
        raise DataError("the estimator's weights are not known", found=why_unknown(data))
    if not isinstance(model, TransferFunctionModel):
        raise ModelError(
            "the estimator's bias is known for transfer functions only",
            found=type(model).__name__,
            needed="TransferFunctionModel",
        )
    systems = pair_systems(model)
    residuals = [
        np.stack(
            [
                _residual(systems, data, linear, record, row, hold)
                for row in range(len(data.outputs))
            ]
        )
        for record in range(len(linear.output_records))
    ]
    left = linear.apply(residuals)
    values = np.array(data.response)
    curves = model.frequency_response(data.omega_rad_s)
    for each in systems:
        row, column = data.outputs.index(each.output), data.inputs.index(each.input)
        place = model.outputs.index(each.output), model.inputs.index(each.input)
        values[row, column] = curves[place] + left[row, column]
    return replace(data, response=values)


def _residual(
    systems: list[PairSystem],
    data: FrequencyResponse,
    linear: LinearEstimate,
    record: int,
    row: int,
    hold: str,
) -> Array:
    """Measured less modelled output of one record, unknown states and trims fitted."""
    measured = linear.output_records[record][row]
    n, step = len(measured), linear.sample_time_s
    mine = [each for each in systems if each.output == data.outputs[row]]
    if not mine:
        return np.asarray(measured)
    if max(each.growth_1_s for each in mine) * n * step > LARGEST_GROWTH:
        raise _diverges(data.outputs[row], "an unstable model on a long record")
    rest, unknown = measured.copy(), [np.ones((n, 1))]
    for each in mine:
        values = linear.input_records[record][linear.inputs.index(each.input)]
        rest -= driven_output(each, values, step, hold)
        unknown.append(free_outputs(each, n, step))
    basis = np.concatenate(unknown, axis=1)
    if not (np.all(np.isfinite(rest)) and np.all(np.isfinite(basis))):
        raise _diverges(data.outputs[row], "a simulation without bounds")
    basis /= np.maximum(np.linalg.norm(basis, axis=0), np.finfo(float).tiny)
    rest -= basis @ np.linalg.lstsq(basis, rest, rcond=_RANK)[0]
    if np.std(rest) > LARGEST_RESIDUAL * np.std(measured):
        ratio = float(np.std(rest) / max(np.std(measured), np.finfo(float).tiny))
        raise _diverges(data.outputs[row], f"a residual {ratio:.0f} times the measured output")
    return np.asarray(rest)


def _diverges(output: str, found: str) -> DataError:
    return DataError(
        f"the model cannot be followed over the records of output {output}",
        found=found,
        needed="a simulation that stays near the measured output",
        action="use shorter records for an unstable model",
    )
