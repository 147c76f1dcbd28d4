"""Does a loop seem to be closed around the vehicle? What a direct estimate must know."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record import Record
from flightid.record.hold import common_loop
from flightid.record.repeats import found_period
from flightid.responses.response import FrequencyResponse
from flightid.responses.windows.samples import Samples
from flightid.uncertainty.fed_noise import fed_noise_spectrum
from flightid.uncertainty.feedback import MAXIMUM_SAMPLES, find_feedback
from flightid.uncertainty.feedback_result import (
    FeedbackTest,
    declared_loop,
    unless_blind,
    unless_spread,
)

HELD = 0.5
"""Share of the samples at which an input that is held by a clock changes at most."""
SAMPLES_A_CYCLE = 8.0
"""Samples kept in a cycle of the highest frequency of interest."""
SAMPLES_FOR_BIAS = 16.0
"""As many for the size of a bias: what is fed back within one seems the vehicle's own."""


def feedback_of(
    samples: Samples, omega_max: float, records: Sequence[Record], loop: str | None
) -> FeedbackTest:
    """Whether a loop was closed: what is declared, else what the records show.

    Parameters
    ----------
    samples : Samples
    omega_max : float
        Highest frequency of interest, rad/s; records are thinned to match.
    records : sequence of Record
        Which may know their loop.
    loop : {"open", "closed"} or None
        The caller's word.

    Raises
    ------
    OptionError
        Another word.
    """
    known = loop or common_loop([each.input_shape for each in records])
    if known is not None:
        return declared_loop(known)
    step, most = _thinning(len(samples.records), omega_max, samples.sample_time_s)
    step = _in_clock(step, samples.part("inputs"))
    # Another band asks the same of the same samples; their first ones tell whether means are off.
    begun = tuple(rows[:, 0].tobytes() for rows in samples.records)
    key = ("feedback", *records[1:], samples.inputs, samples.outputs, begun, step, most)
    test = records[0].once(key, lambda: _tested(samples, step, most))
    names = (*samples.inputs, *samples.outputs)
    return unless_spread(unless_blind(test), [each.history for each in records], names)


def _tested(samples: Samples, step: int, most: int) -> FeedbackTest:
    """The test of thinned records."""
    inputs, outputs = samples.part("inputs"), samples.part("outputs")
    return find_feedback(
        [rows[:, ::step][:, :most] for rows in inputs],
        [rows[:, ::step][:, :most] for rows in outputs],
        samples.inputs,
        repeats=all(found_period(rows) is not None for rows in inputs),
        unthinned=None
        if step == 1
        else ([rows[:, :most] for rows in inputs], [rows[:, :most] for rows in outputs]),
    )


def _thinning(
    n_records: int, omega_max: float, sample_time_s: float, kept: float = SAMPLES_A_CYCLE
) -> tuple[int, int]:
    """Samples to a step, and most of them in a record."""
    step = max(1, int(2.0 * np.pi / (kept * omega_max * sample_time_s)))
    return step, MAXIMUM_SAMPLES // n_records


def _in_clock(step: int, inputs: Sequence[NDArray[np.float64]]) -> int:
    """The longest step up to one that no change of a held input falls between.

    Where a clock of five samples is thinned by two, what it does between kept samples tells when it
    will change next: outputs foretold inputs, and a loop was seen where there was none.
    """
    clock = 0
    for rows in inputs:
        for row in rows:
            changes = np.flatnonzero(np.diff(row))
            if len(changes) < HELD * row.size:
                clock = int(np.gcd.reduce(np.append(np.diff(changes), clock)))
    return next(each for each in range(step, 0, -1) if clock % each == 0)


def feedback_bias(
    response: FrequencyResponse, at_once: Callable[[float], NDArray[np.float64]]
) -> NDArray[np.complex128] | None:
    """Bias of a direct estimate that noise makes by way of a closed loop, (n_out, n_in, n_f).

    ``Φ_uu⁻¹ Φ_uv``: the inputs' spectrum, and that of the inputs with the noise of the outputs.

    Parameters
    ----------
    response : FrequencyResponse
    at_once : callable
        By a sample time, s: what a sample of an input adds to outputs of the same sample, shape
        (n_out, n_in), outputs and inputs of the response.

    Returns
    -------
    ndarray of complex or None
        None where no loop is known to be closed, the records are gone or too short, or inputs that
        the estimate was conditioned on were left out.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.4; Pintelon & Schoukens, 2nd ed., §2.6.4.
    """
    linear, spectrum = response.linear, response.input_spectrum
    if linear is None or spectrum is None or not (response.loop and response.loop.is_closed):
        return None
    if len(linear.places[1]) != len(linear.inputs):
        return None
    order = np.argsort(linear.places[1])
    n_records, highest = len(linear.input_records), float(response.omega_rad_s[-1])
    step, most = _thinning(n_records, highest, linear.sample_time_s, SAMPLES_FOR_BIAS)
    places = np.ix_(linear.places[0], linear.places[1])
    known = np.zeros((len(linear.output_records[0]), len(linear.inputs)))
    known[places] = at_once(step * linear.sample_time_s)
    fed = fed_noise_spectrum(
        [rows[:, ::step][:, :most] for rows in linear.input_records],
        [rows[:, ::step][:, :most] for rows in linear.output_records],
        step * linear.sample_time_s,
        response.omega_rad_s,
        known,
    )
    if fed is None:
        return None
    inputs = spectrum[np.ix_(order, order)].transpose(2, 0, 1)
    bias = np.linalg.solve(inputs, fed).transpose(2, 1, 0)
    return np.asarray(bias[places])


def feedback_findings(test: FeedbackTest) -> tuple[Finding, ...]:
    """What a direct estimate must say of a closed loop."""
    if not test.is_closed:
        return ()
    seen = "a loop was closed, as declared"
    if test.source == "test":
        seen = (
            f"past noise of the outputs explains {100.0 * (test.share or 0.0):.3g} % of what is "
            f"new in input {test.input} (p = {test.p_value:.2g}): a loop seems to be closed"
        )
    return (
        Finding(
            "loop-closed",
            Light.AMBER,
            f"{seen}, and the direct estimate tends to minus the inverse of the controller where "
            "output noise dominates",
            "use estimator='instrument' with the injected excitation, estimator='prewhitened' "
            "where it was not logged, or measure with the loop open",
        ),
    )
