"""What a closed loop makes of a direct estimate's parameters: which of them, and by how much."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import product

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import ModelError
from flightid.findings import Finding
from flightid.identification.frequency_domain.error_model import ErrorModel
from flightid.models import GreyBoxModel, linear_system
from flightid.responses import FrequencyResponse
from flightid.responses.feedback import feedback_bias

Array = NDArray[np.float64]
LOOP_BIAS = "loop-bias"
LARGE, RULING = 0.5, 2.0
"""Bias over the standard error without it from which a parameter is named, and from which red."""


def bias_of_points(
    model: GreyBoxModel, data: FrequencyResponse, errors: ErrorModel, hold: str
) -> Array | None:
    """Bias of the fitted points by a closed loop, in the order of `ErrorModel.propagated`.

    The fitted model tells what an input adds to an output within a sample; what else goes together
    there is the controller's. `hold` is that of the inputs between samples.
    """
    bias = feedback_bias(data, lambda step: _at_once(model, data, step, hold))
    if bias is None or not errors.runs or errors.known is None:
        return None
    parts = []
    for run in errors.runs:
        points = run.points
        block = bias[points.output][np.ix_(points.inputs, points.frequencies)].ravel()
        parts.append(np.concatenate([block.real, block.imag])[run.kept])
    return np.concatenate(parts)


def _at_once(model: GreyBoxModel, data: FrequencyResponse, step_s: float, hold: str) -> Array:
    """What a sample of each input adds to each output at once, shape (n_out, n_in)."""
    found = np.zeros((len(data.outputs), len(data.inputs)))
    with suppress(ModelError):
        held = hold == "zero" and data.linear is not None and step_s == data.linear.sample_time_s
        system = linear_system(model).sampled(step_s, "zero" if held else "first")
        direct = np.asarray(system.d)
        for o, i in product(range(len(data.outputs)), range(len(data.inputs))):
            names = data.outputs[o], data.inputs[i]
            if names[0] in system.outputs and names[1] in system.inputs:
                found[o, i] = direct[system.outputs.index(names[0]), system.inputs.index(names[1])]
    return found


def judge_feedback(
    names: Sequence[str], covariance: Array | None, bias: Array | None
) -> list[Finding]:
    """Name the parameters that noise bends by way of a closed loop.

    Parameters
    ----------
    names : sequence of str
    covariance : ndarray, shape (n, n), or None
        Of the estimates, the square of their bias included.
    bias : ndarray, shape (n,), or None
    """
    if bias is None or covariance is None:
        return []
    variance = np.diag(covariance) - bias**2
    shares = np.abs(bias) / np.sqrt(np.maximum(variance, np.finfo(float).tiny))
    order = [int(k) for k in np.argsort(-shares) if shares[k] >= LARGE]
    if not order:
        return []
    named = ", ".join(f"{names[k]} {bias[k]:+.3g} ({shares[k]:.2g} standard errors)" for k in order)
    return [
        Finding(
            LOOP_BIAS,
            Light.RED if shares[order[0]] >= RULING else Light.AMBER,
            f"the closed loop brings output noise to the inputs, which moves {named}; "
            "so there are no intervals",
            "use estimator='instrument' with the injected signal, estimator='prewhitened' where it "
            "was not logged, or measure with the loop open",
        )
    ]


def why_bent(data: FrequencyResponse, bias: Array | None, bent: Sequence[Finding]) -> str:
    """Why a direct estimate of a closed loop has no intervals; empty where it has.

    Parameters
    ----------
    data : FrequencyResponse
    bias : ndarray or None
        Of the estimates; None where it is not known.
    bent : sequence of Finding
        What `judge_feedback` said of it: a bias that is small beside the bars stays in them.
    """
    if not (data.loop and data.loop.is_closed) or (bias is not None and not bent):
        return ""
    return (
        "a loop was closed and no instrument is given: output noise comes back to the inputs and "
        "moves a direct estimate"
    )
