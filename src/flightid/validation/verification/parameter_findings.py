"""The light of what a record's inputs ask otherwise than its model."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.validation.verification.judgement import THEIL
from flightid.validation.verification.pieces import GROWTH
from flightid.validation.verification.refuted_parameters import RefutedParameter

CODE = "parameter-refuted"
GROSS = 0.25
"""Share of an output's power, as inputs make it, from which another parameter is red by itself."""


def refuted_findings(
    refuted: RefutedParameter | None, beside: Sequence[Finding], *, hold_known: bool
) -> tuple[Finding, ...]:
    """Red where what is said `beside` of the runs is poor, or the difference is gross; else amber.

    Within the guide a prediction is of use, whatever is a little wrong in it. A parameter that is
    another one but changes little is amber, where the inputs between samples are known.
    """
    if refuted is None or not (refuted.is_material or hold_known):
        return ()
    poor = {Light.AMBER, Light.RED}
    is_poor = any(each.code in (THEIL, GROWTH) and each.light in poor for each in beside)
    is_red = refuted.is_material and (is_poor or refuted.share >= GROSS)
    light = Light.RED if is_red else Light.AMBER
    return (
        Finding(
            CODE,
            light,
            refuted.words(hold_known=hold_known),
            "fit the records together, or look for what the model lacks: an input's gain, a lag, "
            "a delay, a coupling",
        ),
    )
