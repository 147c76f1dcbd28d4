"""What a fit would be, were its inputs held otherwise.

The fit is made again from its own estimates under every other hold. How far estimates move, in
their standard errors, says whether the hold matters; how much of the outputs is left says which
hold the data prefer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.evidence.gather import ON_A_WORD
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.methods import Method
from flightid.identification.rival_holds import DECISIVE, DOUBTFUL, OtherHold, Rivals
from flightid.record.chosen_hold import ASSUMED, DECLARED, RECORDED, ChosenHold
from flightid.record.history import FLOWN
from flightid.record.hold import BETWEEN, HOLDS, InputHold, Loop
from flightid.record.repeats import found_staircase, is_rough

Data = Any
NEGLIGIBLE = 0.3
"""Standard errors by which an estimate may move: a 95 % interval then holds 94 in 100."""
OF_A_LOG = (
    "; delays of the model hold the half step for which an autopilot's output stands still "
    "(declare hold='zero' for a log at the loop's rate to take it out)"
)
_TOLD = {DECLARED: "was declared", RECORDED: "the records say"}


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
        if held.source in _TOLD:
            return _told(fit, held, rivals)
        if held.source != ASSUMED or not held.findings:
            return fit, held
        return _asked(fit, held, rivals)
    except FlightidError:
        return fit, held


def _told(fit: Fit, held: ChosenHold, rivals: Rivals) -> tuple[Fit, ChosenHold]:
    """A hold that somebody vouches for: doubted where the data say otherwise."""
    if not rivals.records:
        return fit, held
    rival: InputHold = "zero" if held.hold != "zero" else "band_limited"
    known = rivals.under([rival]) if rivals.is_fed_back else rivals.by_likelihood([rival])
    if not known or known[0].moved <= NEGLIGIBLE:
        return fit, held
    whose = f"as {_TOLD[held.source]}"
    finding = None
    if known[0].doubts:
        if rival != "zero" and not rivals.logged:
            known += rivals.by_likelihood(["first"])
        finding = _contradicted(max(known, key=lambda each: each.gain or 0.0), held.hold, whose)
    elif known[0].is_likely and not rivals.made_by("simulate"):
        steps = _steps_told_otherwise(known[0], rivals, whose) if rival == "zero" else None
        finding = steps or _on_a_word(known[0], held.hold, whose)
    fit = _noted(fit, known)
    if finding is None:
        return fit, held
    if finding.light is not Light.GREEN:
        fit = _widened(fit, rivals.as_fitted(known))
    elif _may_be_either(held.hold, rivals) and not known[0].is_ruled_out:
        fit = _widened(fit, rivals.as_fitted(known))
        finding = replace(finding, message=f"{finding.message}, which the intervals reach")
    return fit, replace(held, findings=(*held.findings, finding))


def _on_a_word(other: OtherHold, taken: InputHold, whose: str) -> Finding:
    """What rests on a hold that was told, and that the data neither bear out nor contradict."""
    return Finding(
        ON_A_WORD,
        Light.GREEN,
        f"inputs are {BETWEEN[taken]} between samples {whose}; the data cannot tell: were they "
        f"{BETWEEN[other.hold]}, {other.parameter} would be {other.moved:.2g} standard errors away",
    )


def _steps_told_otherwise(steps: OtherHold, rivals: Rivals, whose: str) -> Finding | None:
    """Steps in samples that were told as anything else; none where a log shows what it sampled."""
    if rivals.logged:
        return None
    for record in rivals.records:
        for name in rivals.fit.model.inputs:
            stairs: object = found_staircase(record[name])
            if stairs is None and is_rough(record[name]) and (steps.gain or 0.0) > -DOUBTFUL:
                stairs = "moves from sample to sample as a device's steps do, and steps fit alike"
            if stairs is not None:
                return Finding(
                    "hold-contradicted",
                    Light.AMBER,
                    f"inputs are {BETWEEN[rivals.assumed]} between samples, {whose}, yet {name} of "
                    f"{record.name!r} {stairs}; as steps, {steps.parameter} is "
                    f"{steps.moved:.2g} standard errors away",
                    "declare hold='zero' if the vehicle got these steps",
                )
    return None


def _may_be_either(told: InputHold, rivals: Rivals) -> bool:
    """Whether samples bear no witness to the steps, or lines, that they were told as.

    Smooth ones do not. Of a log they are its loop's, and so are rows of a simulated autopilot,
    which between them are nearly lines.
    """
    if told == "band_limited" or rivals.logged or (told == "first" and rivals.made_by(FLOWN)):
        return False
    samples = [record[name] for record in rivals.records for name in rivals.fit.model.inputs]
    return not any(found_staircase(each) is not None or is_rough(each) for each in samples)


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
    fit = _noted(fit, known)
    if finding.light is not Light.GREEN and not rivals.logged:
        fit = _widened(fit, known)
    return fit, replace(held, findings=(*said, finding))


def _noted(fit: Fit, known: Sequence[OtherHold]) -> Fit:
    sizes = {
        each.hold: {"parameter": each.parameter, "moved": each.moved, "gain": each.gain}
        for each in known
    }
    return replace(fit, provenance={**fit.provenance, "other_holds": sizes})


def _contradicted(best: OtherHold, taken: InputHold, whose: str) -> Finding:
    return Finding(
        "hold-contradicted",
        Light.AMBER,
        f"the data say that inputs are {BETWEEN[best.hold]} between samples, not {BETWEEN[taken]} "
        f"{whose}: log-likelihood {best.gain:.3g} higher, {best.parameter} {best.moved:.2g} "
        "standard errors away",
        f"declare hold={best.hold!r} for the record, or the hold that is true; a delay of half a "
        "sample that the model lacks looks alike",
    )


def _widened(fit: Fit, others: Sequence[OtherHold]) -> Fit:
    """The fit whose bars reach what likely other holds would make of the estimates."""
    if fit.covariance is None:
        return fit
    shifts = np.array([each.shift for each in others if each.is_likely])
    covariance = fit.covariance + shifts.T @ shifts if len(shifts) else fit.covariance
    errors = dict(zip(fit.names, np.sqrt(np.diag(covariance)), strict=True))
    known = {
        name: replace(each, stderr=float(errors[name])) if name in errors else each
        for name, each in fit.parameters.items()
    }
    return replace(fit, covariance=covariance, parameters=known)


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
    told = [each for each in matters if each.gain is not None]
    best = max(told, key=lambda each: each.gain or 0.0, default=furthest)
    if best.gain is not None and best.gain > DECISIVE:
        return _contradicted(best, assumed, "as was taken where no record says")
    if len(told) == len(matters) and all((each.gain or 0.0) < -DECISIVE for each in told):
        data = f"{taken}; the data prefer it to every other hold that would move an estimate"
        return Finding("hold-supported", Light.GREEN, data)
    return Finding(
        "hold-unknown",
        Light.AMBER,
        f"{taken}; {BETWEEN[furthest.hold]} would move {size}, and the data cannot tell",
        "declare hold=…: a wrong one shifts delays by half a sample",
    )
