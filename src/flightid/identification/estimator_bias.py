"""What a response's estimator makes of a model: the leakage and finite resolution that it adds.

An estimate is linear in the outputs, Ĥ = L[y]. For a model that gives y* on the measured inputs the
estimator's bias is L[y*] − H, and the estimate without it is H + L[y − y*]: no error where the
model is right, whatever the windows. The model that this needs comes from the fit, in rounds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.identification.model_outputs import (
    System,
    driven_outputs,
    free_outputs,
    split_modes,
    systems_of,
)
from flightid.models import Model
from flightid.responses import FrequencyResponse
from flightid.responses.uncertainty import CovarianceSource

Array = NDArray[np.float64]

LARGEST_RESIDUAL = 10.0
"""Largest residual, in multiples of the measured output's rms, before a simulation is not believed:
a loop may hold an output well below its disturbances, but no model that is right diverges so."""
_RANK = 1e-9
TINY = float(np.finfo(float).tiny)


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
    begin in motion. Unstable modes are followed from the end of a record backwards, so that its
    length is no limit. Coherence and covariance stay; responses that the model lacks stay.

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
    SingularError
        The equations do not give every state derivative.
    DataError
        The weights are not known, or the model diverges on the records.
    """
    linear = data.linear
    if linear is None:
        raise DataError("the estimator's weights are not known", found=why_unknown(data))
    left = linear.apply(_all_residuals(model, data, hold))
    values = np.array(data.response)
    curves = model.frequency_response(data.omega_rad_s)
    for each in model.responses:
        row, column = data.outputs.index(each.output), data.inputs.index(each.input)
        place = model.outputs.index(each.output), model.inputs.index(each.input)
        values[row, column] = curves[place] + left[row, column]
    return replace(data, response=values)


def errors_without_bias(
    model: Model, data: FrequencyResponse, hold: str
) -> CovarianceSource | None:
    """Errors of a response whose bias has been taken out: their noise is what the model leaves.

    The noise of the estimate itself holds the leakage that the correction has removed.

    Parameters
    ----------
    model : Model
    data : FrequencyResponse
        As it was measured, with `linear`.
    hold : str

    Returns
    -------
    CovarianceSource or None
        None where the errors of the response stand as they are.
    """
    if data.linear is None or data.errors is None:
        return None
    return data.linear.errors_of(_all_residuals(model, data, hold))


def _all_residuals(model: Model, data: FrequencyResponse, hold: str) -> list[Array]:
    assert data.linear is not None
    systems, outputs = systems_of(model), {each.output for each in model.responses}
    records = range(len(data.linear.output_records))
    return [_residuals(systems, data, outputs, record, hold) for record in records]


def _residuals(
    systems: list[System],
    data: FrequencyResponse,
    fitted: set[str],
    record: int,
    hold: str,
) -> Array:
    """Measured less modelled outputs of one record, unknown states and trims fitted.

    Outputs that no response of the model needs stay as they are.
    """
    linear = data.linear
    assert linear is not None
    measured = linear.output_records[record]
    n, step = measured.shape[1], linear.sample_time_s
    rest = measured.copy()
    kept = [row for row, name in enumerate(data.outputs) if name in fitted]
    free = []
    for each in systems:
        modes = split_modes(each, n * step)
        places = [linear.inputs.index(name) for name in each.inputs]
        driven = driven_outputs(modes, linear.input_records[record][places], step, hold)
        moving = free_outputs(modes, n, step)
        wide = np.zeros((len(moving), len(rest), n))
        for place, name in enumerate(each.outputs):
            if name in fitted:
                row = data.outputs.index(name)
                rest[row] -= driven[place]
                wide[:, row] = moving[:, place]
        free.append(wide[:, kept])
    names = tuple(data.outputs[row] for row in kept)
    rest[kept] = _less_unknown(names, rest[kept], np.concatenate(free), measured[kept])
    return rest


def _less_unknown(names: tuple[str, ...], rest: Array, free: Array, measured: Array) -> Array:
    """Take out unknown initial states and trims, which all outputs share, and each one's mean.

    Fitted to each output by itself, so many unknowns would take what little a record says of its
    lowest frequencies with them. Outputs count by what they leave in such a fit of their own.
    """
    if not (np.all(np.isfinite(rest)) and np.all(np.isfinite(free))):
        raise _diverges(", ".join(names), "a simulation without bounds")
    rest = rest - rest.mean(axis=1, keepdims=True)
    free = free - free.mean(axis=2, keepdims=True)
    free = free / np.maximum(np.linalg.norm(free, axis=(1, 2), keepdims=True), TINY)
    alone = [
        each - free[:, row].T @ _coefficients(free[:, row].T, each) for row, each in enumerate(rest)
    ]
    scale = np.maximum(np.std(alone, axis=1)[:, None], TINY)
    together = np.reshape(free / scale, (len(free), -1)).T
    found = _coefficients(together, (rest / scale).ravel())
    left = rest - np.tensordot(found, free, axes=1)
    for name, each, whole in zip(names, left, measured, strict=True):
        if np.std(each) > LARGEST_RESIDUAL * np.std(whole):
            ratio = float(np.std(each) / max(np.std(whole), TINY))
            raise _diverges(name, f"a residual {ratio:.0f} times the measured output")
    return np.asarray(left)


def _coefficients(basis: Array, target: Array) -> Array:
    """Least squares by way of the triangular factor, which leaves few rows to the rest."""
    factor: Array = np.asarray(np.linalg.qr(np.column_stack([basis, target]), mode="r"))
    return np.asarray(np.linalg.lstsq(factor[:, :-1], factor[:, -1], rcond=_RANK)[0])


def _diverges(output: str, found: str) -> DataError:
    return DataError(
        f"the model cannot be followed over the records of output {output}",
        found=found,
        needed="a simulation that stays near the measured output",
        action="check the structure, or fit shorter records",
    )
