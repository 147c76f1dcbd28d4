"""What a fit would be, were its inputs held otherwise.

The fit is made again from its own estimates under every other hold. How far estimates move, in
their standard errors, says whether the hold matters; how much of the outputs is left says which
hold the data prefer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.evidence.gather import CONVERGED, ON_A_WORD
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.frequency_domain.estimator_bias import Correction
from flightid.identification.hold_likelihood import (
    HeldOutputs,
    held_outputs,
    records_behind,
)
from flightid.identification.methods import Method, flat
from flightid.identification.rival_fits import estimates_alone
from flightid.record import Record
from flightid.record.chosen_hold import ASSUMED, DECLARED, RECORDED, ChosenHold
from flightid.record.history import is_of_log
from flightid.record.hold import BETWEEN, HOLDS, InputHold
from flightid.record.repeats import found_staircase, is_rough
from flightid.responses import FrequencyResponse
from flightid.uncertainty.foretold import likelihood_gain

Data = Any
NEGLIGIBLE = 0.3
"""Standard errors by which an estimate may move: a 95 % interval then holds 94 in 100."""
DECISIVE = 6.0
"""Difference of log-likelihoods, odds of 400 to 1, that counts as told by the data."""
DOUBTFUL, CHANCE = 1.5, 1.73
"""The same for a hold that was told, and standard deviations of a gain that chance alone exceeds
in 1 of 24 fits: with 1.5 such a fit is doubted no oftener, however far the two lie apart."""
STEPS = 25
"""Most steps of a fit under another hold: it starts half a sample from its end."""
OF_A_LOG = (
    "; delays of the model hold the half step for which an autopilot's output stands still "
    "(declare hold='zero' for a log at the loop's rate to take it out)"
)
_TOLD = {DECLARED: "was declared", RECORDED: "the records say"}
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
    expected : float
        The gain that it would have on average were it true, and the other way round were it not.
    """

    hold: InputHold
    parameter: str
    moved: float
    gain: float | None
    shift: tuple[float, ...] = ()
    expected: float = 0.0

    @property
    def doubts(self) -> bool:
        """Whether it speaks against a hold that was told, by the most powerful test at 4 %."""
        least = DOUBTFUL
        if self.expected > DOUBTFUL:
            least = max(CHANCE * math.sqrt(2.0 * self.expected) - self.expected, 0.0)
        return (self.gain or 0.0) > least

    @property
    def is_likely(self) -> bool:
        """Whether the data do not speak against it."""
        return self.gain is None or self.gain > -DECISIVE


def with_hold_tested(
    fit: Fit, method: Method, data: Data, given: Mapping[str, Any], held: ChosenHold
) -> tuple[Fit, ChosenHold]:
    """The fit with what other holds would make of it.

    Where nobody knows the hold, every other one that is possible is tried; what was told, or what
    records know, is tried against its rival where the data can tell, and nothing is said where they
    do not speak against it.

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
    if fit.covariance is None:
        return fit, held
    rivals = _Rivals(fit, method, data, given, held.hold)
    try:
        if held.source in _TOLD:
            return _told(fit, held, rivals)
        if held.source != ASSUMED or not held.findings:
            return fit, held
        return _asked(fit, held, rivals)
    except FlightidError:
        return fit, held


@dataclass(frozen=True)
class _Rivals:
    """Fits of the same data under other holds, from the estimates of one fit."""

    fit: Fit
    method: Method
    data: Data
    given: Mapping[str, Any]
    assumed: InputHold

    @property
    def logged(self) -> bool:
        """Whether the data come from an autopilot's log."""
        return is_of_log(getattr(each, "history", ()) for each in flat(self.data))

    def made_by(self, operation: str) -> bool:
        """Whether any of the data went through an operation."""
        steps = [step for each in flat(self.data) for step in getattr(each, "history", ())]
        return any(step.operation == operation for step in steps)

    @property
    def records(self) -> list[Record]:
        """All samples that were fitted: of records, and of those behind responses."""
        made = [records_behind(each, self.fit.model) for each in flat(self.data)]
        return [record for records in made for record in records]

    @property
    def is_likeliest(self) -> bool:
        """Whether the fit's estimates are those of least squares on the records by themselves."""
        plain = not {"loss", "noise_covariance", "record_parameters"} & set(self.given)
        by_records = self.method.name == "output_error" and plain
        return by_records and self.fit.termination in CONVERGED

    def under(self, holds: Sequence[InputHold]) -> list[OtherHold]:
        """The fits; none where one of them says nothing."""
        with estimates_alone():
            # Without a gust's states both are quick, and what differs is the hold alone.
            apart = self.fit.responses or self.fit.provenance.get("gust")
            beside = self._again(self.assumed) if apart and holds else self.fit
            found = [_other(hold, self._again(hold), beside, self.fit) for hold in holds]
        return found if all(np.isfinite(each.moved) for each in found) else []

    def by_likelihood(self, holds: Sequence[InputHold]) -> list[OtherHold]:
        """What the records alone say of other holds, without a fit."""
        asked = holds if self.is_likeliest else [self.assumed, *holds]
        found = held_outputs(
            self.fit.model, self.records, self.given, asked, coloured=not self.is_likeliest
        )
        here, *others = [HeldOutputs.of(self.fit), *found] if self.is_likeliest else found
        free = [parameter.name for parameter in self.fit.model.parameters.free]
        places = [free.index(name) for name in self.fit.names]
        return [
            replace(
                _moved_by(
                    hold, self.fit, (there.values - here.values)[places], there.gain_over(here)
                ),
                expected=there.apart_from(here),
            )
            for hold, there in zip(holds, others, strict=True)
        ]

    def as_fitted(self, others: Sequence[OtherHold]) -> list[OtherHold]:
        """Likely holds with what the method itself makes of the estimates under each."""
        likely = [each for each in others if each.is_likely]
        if self.is_likeliest:
            return likely
        made = self.under([each.hold for each in likely]) or likely
        return [replace(own, gain=each.gain) for own, each in zip(made, likely, strict=True)]

    def _again(self, hold: InputHold) -> Fit:
        names = getattr(self.method.options, "__dataclass_fields__", {})
        fresh = {key: value for key, value in _STARTED.items() if key in names}
        # A response keeps what its estimator adds: both holds meet the same points.
        data = _corrected(self.data, hold, self.fit)
        return self.method.run(self.fit.model, data, {**self.given, **fresh, "hold": hold})


def _told(fit: Fit, held: ChosenHold, rivals: _Rivals) -> tuple[Fit, ChosenHold]:
    """A hold that somebody vouches for: doubted where the data say otherwise."""
    if not rivals.records:
        return fit, held
    rival: InputHold = "zero" if held.hold != "zero" else "band_limited"
    known = rivals.by_likelihood([rival])
    if known[0].moved <= NEGLIGIBLE:
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
    fit = fit if finding.light is Light.GREEN else _widened(fit, rivals.as_fitted(known))
    return fit, replace(held, findings=(*held.findings, finding))


def _on_a_word(other: OtherHold, taken: InputHold, whose: str) -> Finding:
    """What rests on a hold that was told, and that the data neither bear out nor contradict."""
    return Finding(
        ON_A_WORD,
        Light.GREEN,
        f"inputs are {BETWEEN[taken]} between samples {whose}; the data cannot tell: were they "
        f"{BETWEEN[other.hold]}, {other.parameter} would be {other.moved:.2g} standard errors away",
    )


def _steps_told_otherwise(steps: OtherHold, rivals: _Rivals, whose: str) -> Finding | None:
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


def _asked(fit: Fit, held: ChosenHold, rivals: _Rivals) -> tuple[Fit, ChosenHold]:
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


def _other(hold: InputHold, other: Fit, beside: Fit, fit: Fit) -> OtherHold:
    shift = [other.parameters[n].value - beside.parameters[n].value for n in fit.names]
    ended = other.termination in CONVERGED | {""} and fit.termination in CONVERGED | {""}
    return _moved_by(hold, fit, np.array(shift), _gain(other, fit) if ended else None)


def _moved_by(hold: InputHold, fit: Fit, shift: np.ndarray, gain: float | None) -> OtherHold:
    moved = [
        abs(size) / (fit.parameters[name].stderr or np.nan)
        for size, name in zip(shift, fit.names, strict=True)
    ]
    furthest = int(np.argmax(moved))
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
    """By the residuals of all outputs in time; None where a fit has none."""
    if not fit.records or fit.responses:
        return None
    rows = [
        [[each.residual(name) for each in one.records] for name in one.costs]
        for one in (fit, other)
    ]
    return sum(likelihood_gain(*pair) for pair in zip(*rows, strict=True))


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
