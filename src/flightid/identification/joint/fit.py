"""Frequency responses and records of one vehicle in one fit, each weighed by its likelihood.

Minimised is ½ eᵀP⁻¹e of the measured responses, with the covariance P of their errors, plus the
negative logarithm of the records' likelihood; native: `joint_objective.rs`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FitError, FlightidError
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import (
    NoiseCost,
    judge_cost,
    judge_intervals,
    rivals,
    why_misfit,
)
from flightid.identification.frequency_domain.bias_findings import (
    TOLERABLE,
    BiasOutcome,
    sizes,
)
from flightid.identification.frequency_domain.bias_objective import Curves, Objective, whitened
from flightid.identification.frequency_domain.bias_starts import further_starts
from flightid.identification.frequency_domain.error_model import ErrorModel, error_model, whitening
from flightid.identification.frequency_domain.estimator_bias import (
    OUTSIDE,
    Correction,
    why_unknown,
)
from flightid.identification.frequency_domain.feedback_findings import (
    LOOP_BIAS,
    bias_of_points,
    why_bent,
)
from flightid.identification.frequency_domain.fit import (
    band_of,
    check_channels,
    check_start,
    compare_responses,
    select_by,
)
from flightid.identification.frequency_domain.left_by_model import LeftByModel
from flightid.identification.frequency_domain.model_curves import curves_of, slopes_of
from flightid.identification.frequency_domain.noise_cost import noise_costs
from flightid.identification.frequency_domain.opened import opened
from flightid.identification.frequency_domain.options import FrequencyDomainOptions
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.identification.frequency_domain.without_bias import AGAIN, CHANCE, MISFIT, RISEN
from flightid.identification.joint.estimator_inside import InsideEnd, again, search_inside
from flightid.identification.joint.independence import judge_independence
from flightid.identification.joint.options import JointOptions
from flightid.identification.multistart import cluster
from flightid.identification.output_error.beside import WhitenedResponses
from flightid.identification.output_error.fit import conclude
from flightid.identification.output_error.search import SearchEnd, searched
from flightid.identification.records.findings import judge_channels
from flightid.identification.records.setup import RecordSet, prepare_records
from flightid.identification.rival_fits import judged
from flightid.identification.withheld_intervals import without_intervals
from flightid.models import GreyBoxModel
from flightid.record import Record
from flightid.responses import FrequencyResponse
from flightid.uncertainty.blocks import JointResiduals
from flightid.uncertainty.response_errors import PointSensitivity

Array = NDArray[np.float64]
MARGIN, MOST_RIVALS = 50.0, 4
"""Log-likelihood from which on a minimum lies too far below the best, and most that are tried."""
SAME_LIKELIHOOD = 0.01
"""Log-likelihood by which searches that end at one minimum differ at most."""


@dataclass(frozen=True)
class ChosenPoints:
    """Fitted points of the responses, with the covariance of their errors."""

    selected: list[SelectedResponse]
    errors: ErrorModel

    @property
    def native(self) -> WhitenedResponses:
        """As the native half takes it; weights of decibels and degrees are not used."""
        none = [np.zeros(len(each.places)) for each in self.selected]
        data = [
            (each.omega_rad_s, each.response, zero, zero)
            for each, zero in zip(self.selected, none, strict=True)
        ]
        return data, whitening(self.errors)

    def beside(self, fitted: GreyBoxModel, extra: Curves | None = None) -> JointResiduals:
        """Derivatives of the whitened errors, by which the fit is a minimum.

        `extra` is what the estimator adds to the model's slopes, (n_free, n) by response.
        """
        slopes = [slope.T for slope in slopes_of(fitted, [e.omega_rad_s for e in self.selected])]
        if extra is not None:
            slopes = [own + more for own, more in zip(slopes, extra, strict=True)]
        weights = whitening(self.errors)
        rows = whitened(slopes, weights).T
        gain = rows.T @ PointSensitivity.of([matrix for *_, matrix in weights])
        levels = self.errors.levels(gain) if judged() else None
        return JointResiduals(rows, rows, levels=levels)

    def whitened_bias(
        self, fitted: GreyBoxModel, response: FrequencyResponse, hold: str
    ) -> Array | None:
        """A loop's bias as residuals of unit variance; None where it is not known."""
        known = bias_of_points(fitted, response, self.errors, hold)
        if known is None:
            return None
        matrices = [matrix for _, _, matrix in whitening(self.errors)]
        ends = np.cumsum([matrix.shape[1] for matrix in matrices])[:-1]
        parts = zip(matrices, np.split(known, ends), strict=True)
        return np.concatenate([matrix @ part for matrix, part in parts])


def fit_jointly(model: GreyBoxModel, data: Sequence[object], options: JointOptions) -> Fit:
    """Fit a model to a frequency response and records together; see `flightid.identify`."""
    response, records = _divided(data)
    of_responses = options.of_responses
    check_channels(model, response)
    points = _points(model, response, of_responses)
    model, nudged = opened(model, points.selected)
    if nudged:
        points = _points(model, response, of_responses)
    prepared = prepare_records(model, records, options)
    setup = [
        *nudged,
        *judge_independence(response, records, model.outputs),
        *judge_channels(prepared),
        *check_start(model, points.selected),
    ]
    found = searched(model, prepared, options, points.native)
    made = _UnbiasedSearch(found, points, None, BiasOutcome("correct_bias=False", possible=False))
    if options.correct_bias:
        made = _without_bias(found, prepared, response, points, options)
        setup += made.outcome.findings()
    beside = made.points.beside(made.found.fitted, made.extra)
    if judged():
        bias = made.points.whitened_bias(made.found.fitted, response, options.hold)
        beside = replace(beside, bias=bias)
    fit = conclude(made.found, options, setup, beside)
    bent = [each for each in fit.findings if each.code == LOOP_BIAS]
    bent_by = why_bent(response, beside.bias, bent)
    curves = curves_of(fit.model, [each.omega_rad_s for each in points.selected])
    noise = noise_costs(points.selected, curves, points.errors) if judged() else {}
    fit = _with_responses(fit, response, made.points, noise, made.outcome, options.hold)
    reason = made.outcome.withheld or why_misfit(fit.average_cost, noise) or bent_by
    return without_intervals(fit, reason) if reason else fit


def _divided(data: Sequence[object]) -> tuple[FrequencyResponse, list[Record]]:
    responses = [item for item in data if isinstance(item, FrequencyResponse)]
    if len(responses) != 1:
        raise DataError(
            "a joint fit takes one frequency response",
            found=len(responses),
            needed="one, of all inputs and outputs, beside the records",
            action="estimate one response from all its records together",
        )
    return responses[0], [item for item in data if isinstance(item, Record)]


def _points(
    model: GreyBoxModel, response: FrequencyResponse, options: FrequencyDomainOptions
) -> ChosenPoints:
    selected = select_by(model, response, options)
    return ChosenPoints(selected, error_model(response, selected))


@dataclass(frozen=True)
class _UnbiasedSearch:
    """A search whose response is free of the estimator's bias, or why it is not."""

    found: SearchEnd
    points: ChosenPoints
    extra: Curves | None
    outcome: BiasOutcome


def _without_bias(
    found: SearchEnd,
    prepared: RecordSet,
    response: FrequencyResponse,
    points: ChosenPoints,
    options: JointOptions,
) -> _UnbiasedSearch:
    """Take the estimator's bias out, and fit again, from each minimum that may be the best.

    Minima of several starts are compared on the corrected response, not where it was biased.
    """
    first = _corrected(found, prepared, response, points, options)
    if not first.outcome.applied:
        return first
    ends = [first]
    for group in rivals(found.groups, found.groups[0][0].cost + MARGIN)[:MOST_RIVALS]:
        # A rival that cannot be followed over the records is none.
        with suppress(FlightidError):
            other = replace(found, groups=[group])
            ends.append(_corrected(other, prepared, response, points, options))
    ranked = sorted(
        (each for each in ends if each.outcome.applied),
        key=lambda each: each.found.groups[0][0].cost,
    )
    groups = cluster([each.found.groups[0][0] for each in ranked])
    return replace(ranked[0], found=replace(ranked[0].found, groups=groups))


def _corrected(
    found: SearchEnd,
    prepared: RecordSet,
    response: FrequencyResponse,
    points: ChosenPoints,
    options: JointOptions,
) -> _UnbiasedSearch:
    """Search from an end with the estimator inside, by the errors that are left at the last."""
    once = replace(options, starts=1)
    without = Correction(response, options.hold)
    objective = Objective(found.fitted, without, points.selected, points.errors, "likelihood")

    def not_done(reason: str, *, possible: bool = True) -> _UnbiasedSearch:
        return _UnbiasedSearch(found, points, None, BiasOutcome(reason, possible))

    reason = why_unknown(response)
    if reason:
        return not_done(reason, possible=False)
    try:
        ends = _ends_inside(found, prepared, once, objective)
        end = ends[0]
        reason = _why_worse(found, ends, objective) or ("" if end.step <= TOLERABLE else end.reason)
        if reason:
            return not_done(reason)
        known = without.errors(end.found.fitted)
        if known is not None:
            errors = error_model(replace(response, errors=known), points.selected)
            objective = replace(objective, errors=errors)
            # The last search weighs the points by the errors that the intervals are computed from.
            end = again(end, prepared, once, objective)
        fitted = end.found.fitted
        after = select_by(fitted, without.apply(fitted), once.of_responses)
    except (FitError, *OUTSIDE) as error:
        return not_done(str(error))
    moved = sizes(points.selected, after, objective.errors)
    outcome = BiasOutcome("", steps=end.steps, last=end.step, sizes=moved)
    return _UnbiasedSearch(end.found, ChosenPoints(after, objective.errors), end.extra, outcome)


def _ends_inside(
    found: SearchEnd, prepared: RecordSet, options: JointOptions, objective: Objective
) -> list[InsideEnd]:
    """Ends with the estimator inside, best first.

    From the fit without correction and, where that ends badly, from the model's own values; where
    the best costs more than without, from values around both too, as fits of responses alone.
    """
    ends = [search_inside(found.fitted, prepared, options, objective)]
    if ends[0].step > TOLERABLE or ends[0].misfit > MISFIT:
        with suppress(FitError, *OUTSIDE):
            ends.append(search_inside(prepared.model, prepared, options, objective))
    if _rise(found, min(ends, key=_worth), objective) is not None:
        own = replace(objective, model=prepared.model)
        fitted = np.array([parameter.value or 0.0 for parameter in found.fitted.parameters.free])
        for start in further_starts(own, fitted):
            with suppress(FitError, *OUTSIDE):
                ends.append(search_inside(own.at(start), prepared, options, objective))
    return sorted(ends, key=_worth)


def _worth(end: InsideEnd) -> tuple[bool, float]:
    return end.step > TOLERABLE, end.cost


def _rise(found: SearchEnd, end: InsideEnd, objective: Objective) -> tuple[float, float] | None:
    """Cost of the response without the estimator, and by how much an end with it costs more.

    None where it costs no more, or no more than chance.
    """
    plain = curves_of(found.fitted, [each.omega_rad_s for each in objective.selected])
    residuals = objective.residuals(plain)
    before = float(residuals @ residuals)
    rise = 2.0 * (end.cost - found.groups[0][0].cost)
    chance = end.misfit <= CHANCE and objective.correction.data.errors is None
    return None if rise <= (RISEN - 1.0) * before or chance else (before, rise)


def _why_worse(found: SearchEnd, ends: Sequence[InsideEnd], objective: Objective) -> str:
    """Why the best end is no minimum to trust: it costs more, and no other start leads there."""
    risen = _rise(found, ends[0], objective)
    met = sum(abs(each.cost - ends[0].cost) <= SAME_LIKELIHOOD for each in ends)
    if risen is None or met >= AGAIN:
        return ""
    return (
        f"it would raise the cost of the response from {risen[0]:.3g} by {risen[1]:.3g}, at a "
        "minimum that no further start meets: there may be lower ones"
    )


def _with_responses(
    fit: Fit,
    response: FrequencyResponse,
    points: ChosenPoints,
    noise: Mapping[str, NoiseCost],
    outcome: BiasOutcome,
    hold: str,
) -> Fit:
    """The fit of the records with its responses beside them."""
    compared = compare_responses(fit.model, points.selected)
    left = None
    if outcome.applied:
        left = LeftByModel(Correction(response, hold), fit.model, band_of(compared))
    costs = {each.name: each.cost for each in compared}
    total = sum(costs.values())
    source = points.errors.source
    return replace(
        fit,
        cost=total,
        average_cost=total / len(costs),
        costs={**costs, **fit.costs},
        responses=compared,
        left=left,
        intervals_from=f"{source} and {fit.intervals_from}",
        findings=(
            *fit.findings,
            *judge_cost(costs, total / len(costs), noise),
            *judge_intervals(
                source,
                outputs_apart=points.errors.outputs_apart,
                noise_taken_for_known=points.errors.noise_taken_for_known,
            ),
        ),
        provenance={
            **fit.provenance,
            "method": "joint",
            "response_history": [str(step) for step in response.history],
            "estimator_bias": outcome.provenance(hold),
        },
    )
