"""Direct responses that a closed loop does not bend: by a long ARX model, whose noise is white."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record import Record
from flightid.record.history import is_of_log
from flightid.record.hold import common_hold
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.responses.errors.prewhitened import (
    NoiseModel,
    PrewhitenedErrors,
    PrewhitenedWeights,
)
from flightid.responses.estimators.conditioned import coherence_of
from flightid.responses.response import FrequencyResponse
from flightid.responses.windows.defaults import WINDOWS_IN_RECORDS
from flightid.responses.windows.samples import Samples

PREWHITENED = "prewhitened"
TINY = float(np.finfo(float).tiny)


def estimate_prewhitened(
    windowed: FrequencyResponse,
    samples: Samples,
    records: Sequence[Record],
    *,
    shifts: int,
    covariance: bool,
) -> FrequencyResponse:
    """The response of a long ARX model, with the spectra of a windowed estimate.

    Its coherence is that which the windows would need for its random error.

    Parameters
    ----------
    windowed : FrequencyResponse
    samples : Samples
    records : sequence of Record
    shifts : int
        Hops in a window.
    covariance : bool

    Raises
    ------
    DataError
        Records too short or too long for a model of the noise.

    Assumes
    -------
    A way around the loop that takes a sample. Inputs that are known to be held (`hold="zero"`),
    or that an autopilot logged, reach outputs a sample later, and the controller may answer at
    once; else the inputs may reach outputs at once, and the controller answers a sample later.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.4: the direct method; its variance there,
    equation 13.61, counts the part of the inputs that no noise moved.
    """
    omega = windowed.omega_rad_s
    held = common_hold([record.input_shape for record in records]) == "zero"
    held = held or is_of_log(record.history for record in records)
    model = NoiseModel.of(
        samples.part("inputs"),
        samples.part("outputs"),
        samples.sample_time_s,
        float(omega[0]),
        direct=not held,
    )
    errors = PrewhitenedErrors(model, omega)
    response = model.response(omega)
    variance = _variance(errors, response)
    relative = np.sqrt(0.5 * variance) / np.maximum(np.abs(response), TINY)
    near = _near(omega)
    smooth = np.sqrt(0.5 * (variance @ near) / np.maximum(np.abs(response) ** 2 @ near, TINY))
    coherence = coherence_of(smooth, WINDOWS_IN_RECORDS, shifts)
    weights = PrewhitenedWeights(model, omega)
    return replace(
        windowed,
        response=response,
        coherence=coherence,
        random_error=relative,
        errors=errors if covariance else None,
        linear=LinearEstimate.of(samples, weights, omega) if covariance else None,
        estimator=PREWHITENED,
        findings=(*windowed.findings, _assumption(held=held)),
    )


def _variance(errors: PrewhitenedErrors, response: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Of complex points, shape (n_out, n_in, n_f)."""
    n_out, n_in, n_f = response.shape
    found = errors.covariance(np.arange(n_out), np.arange(n_in), np.arange(n_f))
    both = np.einsum("opp->op", found).reshape(n_out, 2, n_in, n_f)
    return np.asarray(both.sum(axis=1))


def _near(omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Which frequencies lie within half an octave of which, shape (n_f, n_f)."""
    away = np.abs(np.subtract.outer(np.log2(omega), np.log2(omega)))
    return np.asarray(away <= 0.5, dtype=np.float64)


def _assumption(*, held: bool) -> Finding:
    taken = (
        "inputs are held or an autopilot's own, so the vehicle answers a sample later and a "
        "controller may at once"
        if held
        else "a loop, where there is one, answers a sample later"
    )
    return Finding(
        "noise-modelled",
        Light.GREEN,
        f"a model of the noise keeps what a loop feeds back out of the estimate; taken: {taken}",
    )
