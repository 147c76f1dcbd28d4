"""What a fit would be, were its inputs held otherwise.

The fit is made again from its own estimates under every other hold. How far estimates move, in
their standard errors, says whether the hold matters; how much of the outputs is left says which
hold the data prefer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.methods import Method
from flightid.identification.rival_holds import DECISIVE, NEGLIGIBLE, OtherHold, Rivals
from flightid.identification.told_hold import WHOSE, contradicted, noted, told, widened
from flightid.record.chosen_hold import ASSUMED, ChosenHold
from flightid.record.hold import BETWEEN, HOLDS, InputHold, Loop

Data = Any
OF_A_LOG = (
    "; delays of the model hold the half step for which an autopilot's output stands still "
    "(declare hold='zero' for a log at the loop's rate to take it out)"
)


def with_hold_tested(
    fit: Fit,
    method: Method,
    data: Data,
    given: Mapping[str, Any],
    held: ChosenHold,
    loop: Loop | None = None,
) -> tuple[Fit, ChosenHold]:
    """The fit with what other holds would make of it.

    Where nobody knows the hold, every other one that is possible is tried; what was told, or what
    records know, is tried against its rival where the data can tell, and nothing is said where they
    do not speak against it. Where a loop is closed the records cannot tell.

    Parameters
    ----------
    fit : Fit
    method : Method
    data : FrequencyResponse, Record or sequence
        As `identify` takes it.
    given : mapping
        Options of the fit.
    held : ChosenHold
    loop : {"open", "closed"}, optional
        As declared; default: what the data know, or a test.

    Returns
    -------
    tuple of Fit and ChosenHold
        The hold with the finding that follows in place of the bare question.
    """
    if fit.covariance is None:
        return fit, held
    rivals = Rivals(fit, method, data, given, held.hold, loop)
    try:
        if held.source in WHOSE:
            return told(fit, held, rivals)
        if held.source != ASSUMED or not held.findings:
            return fit, held
        return _asked(fit, held, rivals)
    except FlightidError:
        return fit, held


def _asked(fit: Fit, held: ChosenHold, rivals: Rivals) -> tuple[Fit, ChosenHold]:
    """A hold that was taken where nobody knows."""
    stairs = any(each.light is Light.AMBER for each in held.findings)
    # An autopilot's outputs are steps of its loop, never lines: with half a step of delay, smooth.
    possible: tuple[InputHold, ...] = ("band_limited",) if rivals.logged else HOLDS
    others: list[InputHold] = ["zero"] if stairs else [h for h in possible if h != held.hold]
    known = rivals.under(others)
    if others and not known:
        return fit, held
    finding = judged(known, held.hold)
    if rivals.logged and not stairs:
        finding = replace(finding, message=finding.message + OF_A_LOG)
    said = held.findings if stairs else ()
    fit = noted(fit, known)
    if finding.light is not Light.GREEN and not rivals.logged:
        fit = widened(fit, known)
        furthest = max(known, key=lambda each: each.moved)
        if finding.code == "hold-unknown" and furthest.is_likely:
            finding = replace(finding, message=f"{finding.message}; the intervals reach that")
    return fit, replace(held, findings=(*said, finding))


def judged(others: Sequence[OtherHold], assumed: InputHold) -> Finding:
    """The verdict: green where no estimate moves, or where the data tell the assumed hold.

    Example
    -------
    >>> print(judged([OtherHold("zero", "tau", 0.1, 0.2)], "first").light)
    green
    >>> print(judged([OtherHold("zero", "tau", 9.0, 40.0)], "first").message)
    the data say that inputs are steps between samples, not straight lines as was taken where no \
record says: log-likelihood 40 higher, tau 9 standard errors away
    """
    taken = f"inputs were taken as {BETWEEN[assumed]} between samples, for no record says"
    if not others:
        return Finding("hold-unimportant", Light.GREEN, taken)
    furthest = max(others, key=lambda each: each.moved)
    size = f"{furthest.parameter} {furthest.moved:.2g} standard errors"
    if furthest.moved <= NEGLIGIBLE:
        same = f"{taken}; any other hold moves no estimate further than {size}"
        return Finding("hold-unimportant", Light.GREEN, same)
    matters = [each for each in others if each.moved > NEGLIGIBLE]
    known = [each for each in matters if each.gain is not None]
    best = max(known, key=lambda each: each.gain or 0.0, default=furthest)
    if best.gain is not None and best.gain > DECISIVE:
        return contradicted(best, assumed, "as was taken where no record says")
    if len(known) == len(matters) and all((each.gain or 0.0) < -DECISIVE for each in known):
        data = f"{taken}; the data prefer it to every other hold that would move an estimate"
        return Finding("hold-supported", Light.GREEN, data)
    return Finding(
        "hold-unknown",
        Light.AMBER,
        f"{taken}; {BETWEEN[furthest.hold]} would move {size}, and the data cannot tell",
        "declare hold=…: a wrong one shifts delays by half a sample",
    )
