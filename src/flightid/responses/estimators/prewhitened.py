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
from flightid.record.hold import Loop, common_hold, common_loop
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.responses.errors.noise_memory import COARSER, NOTHING, model_doubt, near
from flightid.responses.errors.prewhitened import (
    NoiseModel,
    PrewhitenedErrors,
    PrewhitenedWeights,
)
from flightid.responses.estimators.conditioned import coherence_of
from flightid.responses.excited_band import excited_span
from flightid.responses.response import FrequencyResponse
from flightid.responses.windows.defaults import WINDOWS_IN_RECORDS
from flightid.responses.windows.samples import Samples

PREWHITENED = "prewhitened"
Real = NDArray[np.float64]
TINY = float(np.finfo(float).tiny)


def estimate_prewhitened(
    windowed: FrequencyResponse,
    samples: Samples,
    records: Sequence[Record],
    *,
    shifts: int,
    covariance: bool,
    loop: Loop | None = None,
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
    loop : {"open", "closed"}, optional
        What was told, in place of what the records know.

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
    shapes = [record.input_shape for record in records]
    held = common_hold(shapes) == "zero"
    held = held or is_of_log(record.history for record in records)
    asked = (samples.part("inputs"), samples.part("outputs"), samples.sample_time_s)
    model = NoiseModel.of(*asked, float(omega[0]), direct=not held)
    response = model.response(omega)
    excited, words = _excited(windowed, loop or common_loop(shapes))
    own = _variance(PrewhitenedErrors(model, omega), response)
    doubt = _doubt(model, own, asked, omega)
    doubt = np.where(excited, doubt, np.maximum(doubt, NOTHING * np.abs(response)))
    errors = PrewhitenedErrors(model, omega, doubt)
    variance = own + doubt**2
    relative = np.sqrt(0.5 * variance) / np.maximum(np.abs(response), TINY)
    around = near(omega)
    smooth = np.sqrt(0.5 * (variance @ around) / np.maximum(np.abs(response) ** 2 @ around, TINY))
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
        findings=(*windowed.findings, _assumption(held=held), *words),
    )


def _variance(errors: PrewhitenedErrors, response: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Of complex points, shape (n_out, n_in, n_f)."""
    n_out, n_in, n_f = response.shape
    found = errors.covariance(np.arange(n_out), np.arange(n_in), np.arange(n_f))
    both = np.einsum("opp->op", found).reshape(n_out, 2, n_in, n_f)
    return np.asarray(both.sum(axis=1))


def _doubt(
    model: NoiseModel,
    variance: Real,
    asked: tuple[Sequence[Real], Sequence[Real], float],
    omega: Real,
) -> Real:
    """Of the model itself: see `model_doubt`."""
    response, beside = model.response(omega), []
    for memory, octave in COARSER:
        other = NoiseModel.of(
            *asked, float(omega[0]), direct=model.direct, memory=memory, octave=octave
        )
        beside.append((other, _variance(PrewhitenedErrors(other, omega), response)))
    return model_doubt(model, variance, beside, omega)


def _excited(
    windowed: FrequencyResponse, loop: Loop | None
) -> tuple[NDArray[np.bool_], list[Finding]]:
    """Where each input has power of its own, shape (n_in, n_f), and words on where it has none.

    Beyond that power a loop shows itself, and models of any memory lean to it alike.
    """
    omega = windowed.omega_rad_s
    found = np.ones((len(windowed.inputs), len(omega)), dtype=bool)
    words: list[Finding] = []
    for row, name in enumerate(windowed.inputs) if loop != "open" else ():
        low, high = excited_span(windowed, name)
        found[row] = (omega >= low) & (omega <= high)
        if not np.all(found[row]):
            words.append(
                Finding(
                    "not-excited",
                    Light.GREEN,
                    f"{name} has power from {low:.3g} to {high:.3g} rad/s: outside, nothing tells "
                    "the vehicle from what a loop feeds back, and no bar is known",
                    "sweep further where the response is wanted there, or declare loop='open' if "
                    "nothing moved the inputs after the outputs",
                )
            )
    return found, words


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
