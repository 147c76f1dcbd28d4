"""Inputs as they reach the vehicle: late by the model's delays, with exact slopes by them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from flightid.errors import ModelError
from flightid.models import StateSpaceModel

Array = NDArray[np.float64]
SPLINE_DEGREE = 3


def delayed_inputs(
    model: StateSpaceModel, values: Array, inputs: Array, sample_time_s: float, hold: str
) -> tuple[Array, Array, Array]:
    """Delayed inputs by a cubic spline; before the first sample an input had that sample's value.

    Parameters
    ----------
    model : StateSpaceModel
    values : ndarray, shape (n_independent,)
        Values of the independent parameters.
    inputs : ndarray, shape (n_inputs, n_samples)
    sample_time_s : float
    hold : {"band_limited", "first", "zero"}
        What the inputs do between samples; steps are late by half a sample.

    Returns
    -------
    delayed : ndarray, shape (n_inputs, n_samples)
    rates : ndarray, shape (n_inputs, n_samples)
        Their time derivatives, unit per s; zero where no free parameter moves a delay.
    slopes : ndarray, shape (n_inputs, n_free)
        Derivatives of the delays by the free parameters, s per parameter unit.

    Raises
    ------
    ModelError
        A negative delay.
    """
    tape = model.parameters.tape(model.delays.values())
    slopes = np.asarray(tape.jacobian(values, model.parameters.free_indices))
    delays = np.asarray(tape.evaluate(values))
    delays = delays + (0.5 * sample_time_s if hold == "zero" else 0.0)
    delayed, rates = inputs.copy(), np.zeros_like(inputs)
    place = np.arange(inputs.shape[1], dtype=np.float64)
    for row, delay in enumerate(delays):
        if delay < 0.0:
            raise ModelError("a delay is negative", found=f"{delay:g} s", needed="0 s or more")
        if delay == 0.0 and not np.any(slopes[row]):
            continue
        spline = make_interp_spline(place, inputs[row], k=min(SPLINE_DEGREE, len(place) - 1))
        when = place - delay / sample_time_s
        before = np.maximum(when, 0.0)
        delayed[row] = spline(before)
        rates[row] = np.where(when > 0.0, spline.derivative()(before), 0.0) / sample_time_s
    return delayed, rates, slopes
