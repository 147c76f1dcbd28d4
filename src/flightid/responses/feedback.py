"""Does a loop seem to be closed around the vehicle? What a direct estimate must know."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record import Record
from flightid.record.hold import common_loop
from flightid.record.repeats import found_period
from flightid.responses.windows.samples import Samples
from flightid.uncertainty.feedback import FeedbackTest, declared_loop, find_feedback

SAMPLES_A_CYCLE = 8.0
"""Samples kept in a cycle of the highest frequency of interest."""
MAXIMUM_SAMPLES = 20000
"""Of all records together."""


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
    step = max(1, int(2.0 * np.pi / (SAMPLES_A_CYCLE * omega_max * samples.sample_time_s)))
    most = MAXIMUM_SAMPLES // len(samples.records)
    inputs, outputs = samples.part("inputs"), samples.part("outputs")
    return find_feedback(
        [rows[:, ::step][:, :most] for rows in inputs],
        [rows[:, ::step][:, :most] for rows in outputs],
        samples.inputs,
        repeats=all(found_period(rows) is not None for rows in inputs),
    )


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
            "use estimator='instrument' with the injected excitation, or fly with the loop open",
        ),
    )
