"""What a hold that nobody knows is worth to a prediction: the same runs under the other holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.identification.prediction.request import Request
from flightid.identification.prediction.result import Prediction
from flightid.record.chosen_hold import ASSUMED, ChosenHold
from flightid.record.hold import BETWEEN, HOLDS, InputHold
from flightid.validation.verification.judgement import numbers_of
from flightid.validation.verification.result import Verification

SMOOTH: tuple[InputHold, ...] = ("first", "band_limited")
NO_MATTER_PERCENT = 1.0
"""Largest change of a fit, in points, that no hold makes matter."""


def hold_findings(
    held: ChosenHold,
    judged: Verification,
    request: Request,
    assumed: InputHold | None,
    run: Callable[[Request], Sequence[Prediction]],
) -> tuple[Finding, ...]:
    """What to say of the hold of a run: nothing to do where no other would change its verdict.

    Parameters
    ----------
    held : ChosenHold
    judged : Verification
        Of the runs under it.
    request : Request
        What those were asked.
    assumed : str or None
        What the fit took where nobody knew. Delays fitted under inputs that move between samples
        hold the half step of inputs that stand still, so that these are no alternative.
    run : callable
        Predictions of all records, as asked.
    """
    if held.source != ASSUMED or not held.findings:
        return held.findings
    moved = 0.0
    for other in HOLDS:
        if other == held.hold or (assumed in SMOOTH and other not in SMOOTH):
            continue
        try:
            made = tuple(run(replace(request, hold=other)))
            found = numbers_of(made, judged.outputs)["fit_percent"]
        except FlightidError:
            return held.findings
        shifts = (found[name] - judged.fit_percent[name] for name in judged.outputs)
        moved = max(moved, *map(abs, shifts))
    if moved >= NO_MATTER_PERCENT:
        return held.findings
    what = (
        f"inputs taken as {BETWEEN[held.hold]} between samples, as no record says; "
        f"taken otherwise, no fit moves by more than {max(moved, 0.01):.2g} points"
    )
    return (Finding("hold-unimportant", Light.GREEN, what),)
