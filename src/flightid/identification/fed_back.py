"""Output error of a black box in a closed loop: by way of the excitation, or without intervals.

A loop feeds noise of the output back to the inputs, and a free run along these takes it for the
vehicle's answer. Where the records hold what was injected, refined instruments keep it out; where
they do not, no bar about the estimate holds the vehicle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from flightid.conventions import Light
from flightid.evidence import feedback_test
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.prediction_error.excited_inputs import is_injected
from flightid.identification.withheld_intervals import without_intervals
from flightid.models.polynomial.structure import METHODS, REFINED, PolynomialStructure
from flightid.record import Record
from flightid.record.hold import Loop
from flightid.uncertainty.feedback_result import FeedbackTest

Asked = TypeVar("Asked")
BIASES, TAKEN = "loop-biases", "by-excitation"


def closed_around(
    structure: object, records: Sequence[object], loop: Loop | None
) -> FeedbackTest | None:
    """The loop that biases an output error by prediction errors; None where none is seen.

    Parameters
    ----------
    structure : object
        Whatever is fitted; polynomial output error alone has such a loop.
    records : sequence of object
        Of the fit.
    loop : {"open", "closed"} or None
        The caller's word.
    """
    if not isinstance(structure, PolynomialStructure) or structure.kind != "OE":
        return None
    held = [each for each in records if isinstance(each, Record)]
    if structure.method != METHODS[0] or not held:
        return None
    test = feedback_test(held, inputs=structure.inputs, outputs=[structure.output], loop=loop)
    return test if test.is_closed else None


def by_excitation(structure: Asked, records: Sequence[object]) -> Asked | None:
    """The same structure by refined instruments; None where the records hold no excitations.

    Parameters
    ----------
    structure : PolynomialStructure
        Around whose records a loop is closed.
    records : sequence of Record
    """
    held = [each for each in records if isinstance(each, Record)]
    if not isinstance(structure, PolynomialStructure) or not is_injected(structure, held):
        return None
    # Refined instruments fit each input a denominator of its own.
    return replace(structure, method=REFINED, denominators="separate")


def with_way_said(fit: Fit, test: FeedbackTest) -> Fit:
    """The fit by way of what was injected, which says why."""
    names = fit.records[0].measured.excitations
    said = f"fitted by way of {', '.join(names)} (riv), which a closed loop does not bias; {test}"
    return replace(fit, findings=(*fit.findings, Finding(TAKEN, Light.GREEN, said)))


def with_bias_said(fit: Fit, test: FeedbackTest) -> Fit:
    """The fit without intervals: nothing in the records keeps the loop's noise out of it."""
    why = (
        f"{test}; output error takes noise that is fed back for the answer, by how much is unknown"
    )
    bare = without_intervals(fit, why)
    action = (
        "name what was injected: excitations; or fit bj or armax, whose noise model keeps a loop "
        "from biasing them; loop='open' where you know it"
    )
    said = Finding(BIASES, Light.AMBER, f"{why}: there are no intervals", action)
    return replace(bare, findings=(*bare.findings, said))
