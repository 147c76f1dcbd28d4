"""Whether a record's inputs ask other parameters of a model, whatever gusts there are.

A poor free run may be one of a right model in gusts. That its inputs answer otherwise than the
model says is told beside them (`parameter_scores`): each parameter is asked alone, the others right
up to their errors. Small differences show in long records too: what is said moves the answer to the
inputs by more than a small share at least.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.identification.filter_error.parameter_scores import ParameterScores, parameter_scores
from flightid.identification.prediction.predict import Predictor
from flightid.identification.prediction.remembered import remembered
from flightid.identification.prediction.request import FREE_RUN, Request
from flightid.identification.prediction.result import Prediction
from flightid.identification.regression.options import FilterErrorOptions
from flightid.identification.uncertain_of import uncertain_of
from flightid.models import StateSpaceModel
from flightid.models.model import model_of
from flightid.record import Record
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.several_tests import holm_adjusted

Array = NDArray[np.float64]
FALSE_ALARMS = 0.001
"""Share of right models of which inputs seem to ask another parameter."""
SURE = 2.0
"""Standard errors by which a parameter may differ less than it seems to."""
MATERIAL = 0.02
"""Share of an output's power, as inputs make it, that other parameters have to change."""
OFF, SEEN = 0.1, 2.5e-5
"""Of a parameter itself, the share by which it surely differs, and the smaller share of an output's
power that it has to change then: models are asked for derivatives too, not for motion alone."""
MOVED = 0.1
"""Share of an output's whole power that inputs have to make of it, to be counted."""
TRIED, STEPS = 2, 4
"""Parameters that are tried as the one that is wrong, those that show most, and steps of each."""
ALIKE = 10.0
"""Of -2 ln p, by which one parameter has to be the better account than another."""
EXPLAINED = 0.25
"""Of the standard errors that show, how many may stay where one parameter is enough."""
STEP = 0.01
"""Of a standard deviation: to first order, as the intervals are."""


@dataclass(frozen=True)
class RefutedParameter:
    """The parameter whose other value would explain most of what inputs contradict.

    Attributes
    ----------
    asked : Estimate
        What the record asks of it if all others are right.
    value : float
        What the model has.
    chance : float
        Of so much in any parameter of a right model (Holm).
    output : str
        That the difference changes most.
    share : float
        Of that output's power, as inputs make it, that it changes at least.
    off : float
        Share of the larger of both values by which they surely differ.
    is_enough : bool
        Whether inputs ask nothing else beside it.
    others : tuple of str
        Parameters that would do as well.
    errors_known : bool
        Whether those of the model's other parameters are, or it came without any; of a fit that
        has no intervals they are not.
    """

    asked: Estimate
    value: float
    chance: float
    output: str
    share: float
    off: float
    is_enough: bool
    others: tuple[str, ...] = ()
    errors_known: bool = True

    @property
    def is_material(self) -> bool:
        """Whether it matters to the motion, whatever the parameter is for."""
        return self.share >= MATERIAL

    @property
    def is_off(self) -> bool:
        """Whether one parameter is surely another one, though it changes little."""
        return self.is_enough and self.errors_known and self.off >= OFF and self.share >= SEEN

    def words(self, *, hold_known: bool = True) -> str:
        """What is said of it: without interval where nobody says how inputs move between samples.

        Steps taken as lines move a value by more than its noise: no such interval of ten held. Nor
        is there one where nobody knows how far the fit's other parameters are off.
        """
        is_sure = hold_known and self.errors_known
        said = (
            f"inputs ask other parameters than the model's (p = {self.chance:.1g}), beside any gust"
        )
        if not self.is_enough:
            return f"{said}: more than one, or dynamics that it lacks, most in {self.output}"
        interval = self.asked.interval() if is_sure else None
        between = f" ({interval[0]:.4g} to {interval[1]:.4g})" if interval else ""
        about = "=" if is_sure else "about"
        unit = f" {self.asked.unit}" if self.asked.unit else ""
        alike = f" (as another {' or '.join(self.others)} would)" if self.others else ""
        return (
            f"{said}: {self.asked.name} {about} {self.asked.value:.4g}{between}{unit} instead of "
            f"{self.value:.4g} would do{alike}, which changes at least "
            f"{100.0 * np.sqrt(self.share):.2g} % of the motion of {self.output}"
        )


@dataclass(frozen=True, eq=False)
class _VerifiedRuns:
    """A model, what its runs are asked, and the runs of one set of values."""

    source: object
    way: Predictor
    made: Sequence[Prediction]
    request: Request

    def scores(
        self, model: StateSpaceModel, made: Sequence[Prediction], noises: Array | None = None
    ) -> ParameterScores | None:
        """Of a model by its own runs."""
        measured = [_about_mean(each.measured, model) for each in made]
        predicted = [_about_mean(each.predicted, model) for each in made]
        return parameter_scores(model, measured, predicted, _options(model, self.request), noises)

    def runs(self, model: StateSpaceModel) -> list[Prediction]:
        """The same runs of another model."""
        return [self.way(model, each.measured, each.outputs, self.request) for each in self.made]


@dataclass(frozen=True, eq=False)
class QuestionedRuns:
    """What was asked of free runs beside their gusts.

    Attributes
    ----------
    refuted : RefutedParameter or None
        What inputs ask otherwise, if anything that matters.
    innovations : tuple of ndarray, shape (n_outputs, n_samples)
        What a filter with the record's own noises leaves of the last samples of each record, as
        good as new at each; none where the model cannot be asked.
    """

    refuted: RefutedParameter | None = None
    innovations: tuple[Array, ...] = ()

    @property
    def is_refuted(self) -> bool:
        """Whether gusts are no excuse."""
        return self.refuted is not None and self.refuted.is_material


def questioned(
    source: object, way: Predictor, made: Sequence[Prediction], request: Request
) -> QuestionedRuns:
    """What a free run's inputs ask otherwise, and what a filter leaves of it.

    Parameters
    ----------
    source : object
        Anything that can be verified; equations with free parameters alone are asked.
    way : callable
        What predicts with it.
    made : sequence of Prediction
    request : Request

    Assumes
    -------
    Inputs that answer no gust within the sample. A parameter that is right beside dynamics that the
    model lacks may be asked to do their work.

    Reference
    ---------
    Rao (1948), Proc. Cambridge Philosophical Society 44; Holm (1979), Scandinavian J. Statistics 6.
    """
    model = model_of(source)
    whole = all(each.diverged_at is None for each in made)
    if not isinstance(model, StateSpaceModel) or request.horizon != FREE_RUN or not whole:
        return QuestionedRuns()
    if remembered(source).record_parameters or len(made[0].outputs) < len(model.outputs):
        return QuestionedRuns()
    asked = _VerifiedRuns(source, way, made, request)
    scores = asked.scores(model, made)
    if scores is None:
        return QuestionedRuns()
    refuted = _refuted(asked, model, scores)
    return QuestionedRuns(refuted, scores.innovations)


def _refuted(
    asked: _VerifiedRuns, model: StateSpaceModel, scores: ParameterScores
) -> RefutedParameter | None:
    known = _known(asked.source, scores.names)
    shown, chances = _shown(scores, known)
    if np.min(chances) >= FALSE_ALARMS:
        return None
    found = [
        each
        for place in np.argsort(-shown)[:TRIED]
        if chances[place] < FALSE_ALARMS
        and (each := _followed(asked, model, (scores, known), int(place))) is not None
    ]
    found.sort(key=lambda each: each[0])
    best = [each for _, each in found[:1]]
    alike = [each for far, each in found[1:] if each.is_enough and far < found[0][0] + ALIKE]
    # Gusts leave open whether one is a hundredth off or another a third: what matters is said.
    said = next((each for each in best + alike if each.is_material or each.is_off), None)
    if said is None:
        return None
    others = tuple(each.asked.name for each in best + alike if each is not said and each.is_enough)
    return replace(said, chance=float(np.min(chances)), others=others)


def _shown(scores: ParameterScores, known: Array | None) -> tuple[Array, Array]:
    """Standard errors by which each parameter seems wrong, and their chances together."""
    moves, stderr = scores.alone(known)
    shown = np.abs(moves) / stderr
    return shown, holm_adjusted(scipy.special.erfc(shown / np.sqrt(2.0)))


def _followed(
    asked: _VerifiedRuns,
    model: StateSpaceModel,
    at: tuple[ParameterScores, Array | None],
    place: int,
) -> tuple[float, RefutedParameter] | None:
    """-2 ln p and what is said of one parameter where its own slope vanishes, by secants.

    All others are held; None where its runs end.
    """
    first, known = at
    name, now, made = first.names[place], first, asked.made
    value = float(first.values[place])
    move = step = float(now.alone(known)[0][place])
    for _ in range(STEPS):
        value += step
        try:
            moved = model.with_values({name: value})
            made = asked.runs(moved)
        except FlightidError:
            return None
        found = asked.scores(moved, made, first.noises)
        if found is None or found.names != first.names:
            return None
        now, before = found, move
        moves, stderr = now.alone(known)
        move = float(moves[place])
        if abs(move) < stderr[place] or move == before:
            break
        step *= move / (before - move)
    moves, stderr = now.alone(known)
    had, tiny = float(first.values[place]), np.finfo(float).tiny
    far = abs(value - had)
    sure = max(1.0 - SURE * float(stderr[place]) / max(far, tiny), 0.0)
    shares = _changed(asked.made, made)
    # What is wrong makes a part of the error, whatever one parameter would have to change.
    least = {output: min(sure**2 * moved, error) for output, (moved, error) in shares.items()}
    output = max(least, key=lambda each: least[each])
    left, chances = _shown(now, known)
    is_enough = np.min(chances) >= FALSE_ALARMS or (
        np.max(left) < EXPLAINED * np.max(_shown(first, known)[0])
    )
    return now.misfit_beside(known), RefutedParameter(
        Estimate(name, value, model.parameters[name].unit, float(now.value_errors(known)[place])),
        had,
        0.0,
        output,
        least[output],
        sure * far / max(abs(value), abs(had), tiny),
        is_enough=bool(is_enough),
        errors_known=known is not None or asked.source is model,
    )


def _options(model: StateSpaceModel, request: Request) -> FilterErrorOptions:
    """Constants of linear models are free: their inputs are asked about the record's mean."""
    free = (True, True) if model.is_linear else (request.state_bias, request.output_bias)
    return FilterErrorOptions(input_bias=free[0], output_bias=free[1], hold=request.hold)


def _about_mean(record: Record, model: StateSpaceModel) -> Record:
    if not model.is_linear:
        return record
    return record.replace({name: record[name] - record[name].mean() for name in model.inputs})


def _known(source: object, names: Sequence[str]) -> Array | None:
    """Covariance of parameters over repeated flights; None where none is known."""
    moved = []
    try:
        uncertain = uncertain_of(source)
        if uncertain.covariance is None:
            return None
        for ends in uncertain.steps(STEP):
            up, down = (_values(model_of(each), names) for each in ends)
            moved.append(up - down)
    except FlightidError:
        return None
    directions = np.array(moved).reshape(-1, len(names)) / (2.0 * STEP)
    return np.asarray(directions.T @ directions)


def _values(model: object, names: Sequence[str]) -> Array:
    assert isinstance(model, StateSpaceModel)
    return np.array([model.parameters[name].value for name in names], dtype=np.float64)


def _changed(
    made: Sequence[Prediction], again: Sequence[Prediction]
) -> dict[str, tuple[float, float]]:
    """Shares of each output's power that other runs change, and of the error.

    Of the power that inputs make, where that is not too little to matter; of all records together.
    """
    found = {}
    for output in made[0].outputs:
        power = np.zeros(4)
        for one, two in zip(made, again, strict=True):
            y, y_hat = one.scored(output)
            moved = two.scored(output)[1] - y_hat
            power += [np.sum(each**2) for each in (moved, y - y_hat, y_hat, y)]
        share = power[:2] / max(power[2], MOVED * power[3])
        found[output] = (float(share[0]), float(share[1]))
    return found
