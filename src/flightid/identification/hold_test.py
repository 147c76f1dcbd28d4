"""What a fit would be, were its inputs held otherwise: where no record knows its hold.

The fit is made again from its own estimates under every other hold. How far estimates move, in
their standard errors, says whether the hold matters; how much of the outputs is left says which
hold the data prefer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.evidence.gather import CONVERGED, FROM_LOG
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.frequency_domain.estimator_bias import Correction
from flightid.identification.methods import Method, flat
from flightid.identification.rival_fits import estimates_alone
from flightid.record.chosen_hold import ASSUMED, ChosenHold
from flightid.record.hold import BETWEEN, HOLDS, InputHold
from flightid.responses import FrequencyResponse

Data = Any
NEGLIGIBLE = 0.3
"""Standard errors by which an estimate may move: a 95 % interval then holds 94 in 100."""
DECISIVE = 6.0
"""Difference of log-likelihoods, odds of 400 to 1, that counts as told by the data."""
STEPS = 25
"""Most steps of a fit under another hold: it starts half a sample from its end."""
OF_A_LOG = (
    "; delays of the model hold the half step for which an autopilot's output stands still "
    "(declare hold='zero' for a log at the loop's rate to take it out)"
)
_STARTED = {"starts": 1, "start_from": "model", "maximum_iterations": STEPS, "correct_bias": False}


@dataclass(frozen=True)
class OtherHold:
    """A fit under another hold.

    Attributes
    ----------
    hold : {"zero", "first", "band_limited"}
    parameter : str
        The estimate that moves furthest, in standard errors.
    moved : float
        By how many.
    gain : float or None
        Logarithm of the likelihood less that of the hold that was assumed; None where a search did
        not end, or the method minimises none that can be compared.
    shift : tuple of float
        By how much each estimate moves, in the order of the fit's covariance.
    """

    hold: InputHold
    parameter: str
    moved: float
    gain: float | None
    shift: tuple[float, ...] = ()

    @property
    def is_likely(self) -> bool:
        """Whether the data do not speak against it."""
        return self.gain is None or self.gain > -DECISIVE


def with_hold_tested(
    fit: Fit, method: Method, data: Data, given: Mapping[str, Any], held: ChosenHold
) -> tuple[Fit, ChosenHold]:
    """The fit with what other holds would make of it; as it is where the hold is known.

    Parameters
    ----------
    fit : Fit
    method : Method
    data : FrequencyResponse, Record or sequence
        As `identify` takes it.
    given : mapping
        Options of the fit.
    held : ChosenHold

    Returns
    -------
    tuple of Fit and ChosenHold
        The hold with the finding that follows in place of the bare question.
    """
    if held.source != ASSUMED or not held.findings or fit.covariance is None:
        return fit, held
    stairs = any(each.light is Light.AMBER for each in held.findings)
    steps = [step for each in flat(data) for step in getattr(each, "history", ())]
    logged = any(step.operation == FROM_LOG for step in steps)
    # An autopilot's outputs are steps of its loop, never lines: with half a step of delay, smooth.
    possible: tuple[InputHold, ...] = ("band_limited",) if logged else HOLDS
    others: list[InputHold] = ["zero"] if stairs else [h for h in possible if h != held.hold]

    def again(hold: InputHold) -> Fit:
        return method.run(fit.model, _corrected(data, hold, fit), {**given, **fresh, "hold": hold})

    names = getattr(method.options, "__dataclass_fields__", {})
    fresh = {key: value for key, value in _STARTED.items() if key in names}
    try:
        # A response keeps what its estimator adds: both holds meet the same points.
        with estimates_alone():
            # Without a gust's states both are quick, and what differs is the hold alone.
            apart = fit.responses or fit.provenance.get("gust")
            beside = again(held.hold) if apart and others else fit
            known = [_other(hold, again(hold), beside, fit) for hold in others]
    except FlightidError:
        return fit, held
    if not all(np.isfinite(each.moved) for each in known):
        return fit, held
    sizes = {
        each.hold: {"parameter": each.parameter, "moved": each.moved, "gain": each.gain}
        for each in known
    }
    finding = judged(known, held.hold)
    if logged and not stairs:
        finding = replace(finding, message=finding.message + OF_A_LOG)
    said = held.findings if stairs else ()
    fit = replace(fit, provenance={**fit.provenance, "other_holds": sizes})
    if finding.light is not Light.GREEN and not logged:
        fit = _widened(fit, known)
    return fit, replace(held, findings=(*said, finding))


def _other(hold: InputHold, other: Fit, beside: Fit, fit: Fit) -> OtherHold:
    shift = [other.parameters[n].value - beside.parameters[n].value for n in fit.names]
    moved = [
        abs(size) / (fit.parameters[name].stderr or np.nan)
        for size, name in zip(shift, fit.names, strict=True)
    ]
    furthest = int(np.argmax(moved))
    ended = other.termination in CONVERGED | {""} and fit.termination in CONVERGED | {""}
    gain = _gain(other, fit) if ended else None
    return OtherHold(
        hold, fit.names[furthest], float(moved[furthest]), gain, tuple(map(float, shift))
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


def _corrected(data: Data, hold: InputHold, fit: Fit) -> Data:
    """Data whose responses are without what their estimators add under that hold."""
    if isinstance(data, FrequencyResponse):
        return data if data.linear is None else Correction(data, hold).apply(fit.model)
    if isinstance(data, list | tuple):
        return [_corrected(each, hold, fit) for each in data]
    return data


def _gain(other: Fit, fit: Fit) -> float | None:
    """½ Σ n ln(power left before / after), n the independent samples of each output's residuals."""
    if not fit.records or fit.responses:
        return None
    total = 0.0
    for name, cost in fit.costs.items():
        rows = [each.residual(name) for each in fit.records]
        count = sum(len(row) * _independent(row) for row in rows)
        tiny = np.finfo(float).tiny
        total += 0.5 * count * float(np.log(max(cost, tiny) / max(other.costs[name], tiny)))
    return total


def _independent(row: np.ndarray) -> float:
    """Share of samples that count, by the first autocorrelation."""
    power = float(row @ row)
    first = float(row[1:] @ row[:-1]) / power if power > 0.0 else 0.0
    return (1.0 - max(first, 0.0)) / (1.0 + max(first, 0.0))


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
        said = f"{taken}; any other hold moves no estimate further than {size}"
        return Finding("hold-unimportant", Light.GREEN, said)
    matters = [each for each in others if each.moved > NEGLIGIBLE]
    told = [each for each in matters if each.gain is not None]
    best = max(told, key=lambda each: each.gain or 0.0, default=furthest)
    if best.gain is not None and best.gain > DECISIVE:
        return Finding(
            "hold-contradicted",
            Light.AMBER,
            f"the data say that inputs are {BETWEEN[best.hold]} between samples, not "
            f"{BETWEEN[assumed]} as was taken where no record says: log-likelihood "
            f"{best.gain:.3g} higher, {best.parameter} {best.moved:.2g} standard errors away",
            f"declare hold={best.hold!r} for the record, or the hold that is true",
        )
    if len(told) == len(matters) and all((each.gain or 0.0) < -DECISIVE for each in told):
        said = f"{taken}; the data prefer it to every other hold that would move an estimate"
        return Finding("hold-supported", Light.GREEN, said)
    return Finding(
        "hold-unknown",
        Light.AMBER,
        f"{taken}; {BETWEEN[furthest.hold]} would move {size}, and the data cannot tell",
        "declare hold=…: a wrong one shifts delays by half a sample",
    )
