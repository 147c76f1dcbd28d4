"""Other holds of a fit's inputs: what estimates and outputs would be under each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from flightid.evidence.feedback import loop_seen
from flightid.evidence.gather import CONVERGED
from flightid.frozen import dataclass
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
from flightid.record.history import is_of_log
from flightid.record.hold import InputHold, Loop
from flightid.responses import FrequencyResponse
from flightid.uncertainty.foretold import likelihood_gain
from flightid.uncertainty.quantiles import half_width

Data = Any
DECISIVE = 6.0
"""Difference of log-likelihoods, odds of 400 to 1, that counts as told by the data."""
DOUBTFUL, CHANCE = 1.5, 1.73
"""The same for a hold that was told, and standard deviations of a gain that chance alone exceeds
in 1 of 24 fits: with 1.5 such a fit is doubted no oftener, however far the two lie apart."""
SELDOM, RARE = 2.05, 2.58
"""Standard deviations below its mean at which a gain is found in 1 of 50 and 1 of 200 fits: what
rules out a rival within the intervals, and one beyond them. With 1 of 50 for all, wrong words were
green beside a delay half a sample off in 1 to 4 % of flights."""
WITHIN = half_width()
"""Standard errors up to which a rival's estimates lie in the intervals."""
NEGLIGIBLE = 0.3
"""Standard errors by which an estimate may move: a 95 % interval then holds 94 in 100."""
STEPS = 25
"""Most steps of a fit under another hold: it starts half a sample from its end."""
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
    unit : str
        Of the estimate that moves furthest.
    change : float or None
        By how much that one moves, in `unit`.
    """

    hold: InputHold
    parameter: str
    moved: float
    gain: float | None
    shift: tuple[float, ...] = ()
    expected: float = 0.0
    unit: str = ""
    change: float | None = None

    @property
    def by(self) -> str:
        """In words, by how much the estimate that moves furthest does."""
        if self.change is None:
            return ""
        return f", {abs(self.change):.2g} {self.unit} {'larger' if self.change > 0 else 'smaller'}"

    @property
    def doubts(self) -> bool:
        """Whether it speaks against a hold that was told, by the most powerful test at 4 %."""
        least = DOUBTFUL
        if self.expected > DOUBTFUL:
            least = max(CHANCE * math.sqrt(2.0 * self.expected) - self.expected, 0.0)
        return (self.gain or 0.0) > least

    @property
    def is_ruled_out(self) -> bool:
        """Whether the data would look as they do in 1 of 200 fits at most, were it true.

        In 1 of 50 where it moves no estimate out of its interval.
        """
        sure = RARE if self.moved > WITHIN else SELDOM
        least = self.expected - sure * math.sqrt(2.0 * self.expected)
        return self.gain is not None and self.gain < min(least, -DOUBTFUL)

    @property
    def is_open(self) -> bool:
        """Whether the data leave it open, as they do where nobody could ask them."""
        return self.is_likely and not self.is_ruled_out

    @property
    def is_likely(self) -> bool:
        """Whether the data do not speak against it."""
        return self.gain is None or self.gain > -DECISIVE


@dataclass(frozen=True)
class Rivals:
    """Fits of the same data under other holds, from the estimates of one fit."""

    fit: Fit
    method: Method
    data: Data
    given: Mapping[str, Any]
    assumed: InputHold
    loop: Loop | None = None

    @cached_property
    def is_fed_back(self) -> bool:
        """Whether what the outputs did may have moved the inputs.

        Smooth and straight inputs between samples are made of samples to come: those know what
        gusts and noise did by then where a loop is closed, and leave less in any case.
        """
        if self.loop is not None:
            return self.loop == "closed"
        return any(_is_fed_back(each, self.fit) for each in flat(self.data))

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
        if self.is_fed_back:
            found = [replace(each, gain=None) for each in found]
        return found if all(np.isfinite(each.moved) for each in found) else []

    def by_likelihood(self, holds: Sequence[InputHold]) -> list[OtherHold]:
        """What the records alone say of other holds, without a fit."""
        asked = holds if self.is_likeliest else [self.assumed, *holds]
        found = self._held(asked)
        if not self.is_likeliest:
            return self._beside(found[0], holds, found[1:])
        known = self._beside(HeldOutputs.of(self.fit), holds, found)
        if any(each.doubts for each in known):
            # The fit's own hold is stepped as its rivals were before one of them is preferred.
            known = self._beside(self._held([self.assumed])[0], holds, found)
        return known

    def _held(self, holds: Sequence[InputHold]) -> list[HeldOutputs]:
        return held_outputs(
            self.fit.model,
            self.records,
            self.given,
            holds,
            coloured=not self.is_likeliest,
            assumed=self.assumed,
            beside=self.fit if self.is_likeliest else None,
        )

    def _beside(
        self, here: HeldOutputs, holds: Sequence[InputHold], others: Sequence[HeldOutputs]
    ) -> list[OtherHold]:
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
        return [
            replace(own, gain=each.gain, expected=each.expected)
            for own, each in zip(made, likely, strict=True)
        ]

    def _again(self, hold: InputHold) -> Fit:
        names = getattr(self.method.options, "__dataclass_fields__", {})
        fresh = {key: value for key, value in _STARTED.items() if key in names}
        options = {**self.given, **fresh, "hold": hold}
        # A response keeps what its estimator adds to a model that ends where this hold takes it.
        rounds = 2 if self.fit.responses and hold != self.assumed else 1
        found = self.fit
        for _ in range(rounds):
            data = _corrected(self.data, hold, found)
            found = self.method.run(found.model, data, options)
        return found


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
    name = fit.names[furthest]
    return OtherHold(
        hold,
        name,
        float(moved[furthest]),
        gain,
        tuple(map(float, shift)),
        unit=fit.parameters[name].unit,
        change=float(shift[furthest]),
    )


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


def _is_fed_back(data: object, fit: Fit) -> bool:
    known = data.loop if isinstance(data, FrequencyResponse) else None
    if isinstance(data, Record):
        known = loop_seen((data,), tuple(fit.model.inputs), tuple(fit.model.outputs))
    if known is None:
        return False
    return known.loop == "closed" or known.is_taken_care_of or known.source == "same sample"
