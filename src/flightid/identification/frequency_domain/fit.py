"""Fit of a model to frequency responses (native side: `frequency_fit.rs`).

Cost of one response: (20/n) Σ W_γ [W_g (Δ dB)² + W_p (Δ phase in degrees)²], phase wrapped.
Or, with ``cost="likelihood"``, the whitened complex error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FitError
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import (
    NoiseCost,
    judge_correlation,
    judge_cost,
    judge_intervals,
    judge_parameters,
    judge_search,
    why_misfit,
)
from flightid.identification.fitted_response import FittedResponse
from flightid.identification.frequency_domain.bias_objective import Curves, Objective
from flightid.identification.frequency_domain.error_model import (
    ErrorModel,
    coherence_sensitivity,
    error_model,
    whitening,
)
from flightid.identification.frequency_domain.estimates import Statistics, statistics
from flightid.identification.frequency_domain.estimator_bias import Correction
from flightid.identification.frequency_domain.feedback_findings import (
    bias_of_points,
    judge_feedback,
    why_bent,
)
from flightid.identification.frequency_domain.left_by_model import LeftByModel
from flightid.identification.frequency_domain.longer_windows import judge_windows
from flightid.identification.frequency_domain.misfit import misfit_forms, why_missed
from flightid.identification.frequency_domain.model_curves import curves_of, looks_of, start_curves
from flightid.identification.frequency_domain.noise_cost import noise_costs
from flightid.identification.frequency_domain.noisy_points import (
    judge_weights,
    why_weighed_by_chance,
    without_vague,
)
from flightid.identification.frequency_domain.opened import opened
from flightid.identification.frequency_domain.options import FrequencyDomainOptions
from flightid.identification.frequency_domain.response_parts import PartComparison
from flightid.identification.frequency_domain.search import minimise
from flightid.identification.frequency_domain.selection import (
    SelectedResponse,
    select_points,
)
from flightid.identification.frequency_domain.setup_checks import Start, check_setups
from flightid.identification.frequency_domain.unseen import with_starts
from flightid.identification.frequency_domain.without_bias import far_from_best, take_out
from flightid.identification.multistart import DenseEnd, cluster, local_minima, require_free
from flightid.identification.rival_fits import judged
from flightid.identification.withheld_intervals import without_intervals
from flightid.models import GreyBoxModel
from flightid.responses import FrequencyResponse
from flightid.uncertainty.response_errors import DECIBEL, DEGREE, PointSensitivity, Sensitivity
from flightid.units import require_match
from flightid.version import VERSION

Array = NDArray[np.float64]


def fit_responses(
    model: GreyBoxModel, data: FrequencyResponse, options: FrequencyDomainOptions
) -> Fit:
    """Fit a model to measured responses; see `flightid.identify`."""
    check_channels(model, data)
    selected = select_by(model, data, options)
    model, nudged = opened(model, selected)
    setup = [*nudged, *check_start(model, selected)]
    try:
        return with_starts(_fit_selected(model, data, selected, setup, options), model)
    except FitError as error:
        if not setup:
            raise
        # What looked wrong before the fit is the likeliest reason why there is none.
        steps = [error.action or "", *(f"{each.message} — {each.action}" for each in setup)]
        action = "; ".join(step for step in steps if step)
        raise FitError(
            error.problem, found=error.found, needed=error.needed, action=action
        ) from error


def _fit_selected(
    model: GreyBoxModel,
    data: FrequencyResponse,
    selected: list[SelectedResponse],
    setup: list[Finding],
    options: FrequencyDomainOptions,
) -> Fit:
    errors = error_model(data, selected)
    by_noise = errors
    groups = cluster(_minimise(model, selected, errors, options))
    correction: dict[str, object] = {"applied": False, "reason": "correct_bias=False"}
    fitted, curves, withheld, compare = _at(model, groups[0][0]), None, "", None
    if options.correct_bias:
        without = Correction(data, options.hold)
        objective = Objective(model, without, selected, errors, options.cost)
        done = take_out(objective, groups, lambda found: select_by(model, found, options))
        outcome, withheld = done.outcome, done.outcome.withheld
        setup += outcome.findings()
        correction = outcome.provenance(options.hold)
        if outcome.applied:
            # Minima far above the best keep the cost of the search without correction.
            groups = [*done.groups, *far_from_best(groups)]
            selected, errors, fitted = list(done.selected), done.errors, done.model
            curves = done.estimates
    responses = compare_responses(fitted, selected)
    points = [each.model[chosen.places] for each, chosen in zip(responses, selected, strict=True)]
    compared = points if curves is None else curves
    sensitivity = _sensitivity(selected, errors, options, compared) if judged() else None
    if curves is not None and errors.known is not None and sensitivity is not None:
        # Residuals answer to points and to the model's estimates with opposite signs.
        slopes = -sensitivity.solved(groups[0][0].jacobian)
        if data.linear is not None and data.linear.weights.tells_parts:
            compare = PartComparison(without, fitted, selected, errors, slopes).compare
    bias = bias_of_points(fitted, data, errors, options.hold) if judged() else None
    found = statistics(
        fitted,
        selected,
        errors,
        groups[0][0],
        sensitivity=sensitivity,
        weighs_coherence=options.cost == "coherence" and curves is None,
        weighs_errors=options.cost == "likelihood",
        withheld=withheld,
        compare=compare,
        bias=bias,
    )
    bent = judge_feedback(found.names, found.covariance, found.bias)
    chance = why_weighed_by_chance(data, selected, options.cost)
    setup += [*bent, *judge_weights(chance), *judge_windows(fitted, data)]
    noise = noise_costs(selected, points, by_noise) if judged() else {}
    missed = ""
    if curves is not None and by_noise.known is not None and sensitivity is not None:
        missed = why_missed(misfit_forms(groups[0][0], sensitivity, bias, by_noise, selected))
    fit = _assemble(fitted, options, data, groups, responses, found, setup, noise)
    left = None if curves is None else LeftByModel(without, fitted, band_of(responses))
    fit = replace(fit, provenance={**fit.provenance, "estimator_bias": correction}, left=left)
    fit = replace(fit, missed=missed)
    reason = why_misfit(fit.average_cost, noise) or why_bent(data, found.bias, bent) or chance
    if withheld:
        return fit
    return without_intervals(fit, reason) if reason else without_vague(fit, data, selected)


def select_by(
    model: GreyBoxModel, data: FrequencyResponse, options: FrequencyDomainOptions
) -> list[SelectedResponse]:
    """Points of the model's responses that the options choose."""
    return select_points(
        data,
        model.response_names,
        bands=options.band_rad_s,
        n_omega=options.n_omega,
        minimum_coherence=options.minimum_coherence,
        weight_gain=options.weight_gain,
        weight_phase=options.weight_phase,
    )


def _at(model: GreyBoxModel, end: DenseEnd) -> GreyBoxModel:
    names = (parameter.name for parameter in model.parameters.free)
    return model.with_values(dict(zip(names, map(float, end.x), strict=True)))


def check_channels(model: GreyBoxModel, data: FrequencyResponse) -> None:
    """Refuse a model without free parameters, and data without its channels or units.

    Raises
    ------
    FitError
        No free parameter.
    UnknownNameError
        A response of the model is not in the data.
    UnitError
        Data and model disagree on a unit.
    """
    require_free(model)
    outputs, inputs = set(data.outputs), set(data.inputs)
    for response in model.responses:
        if response.output not in outputs or response.input not in inputs:
            data.pair(response.output, response.input)  # which says what there is
    # Outputs of a model that no fitted response needs may be missing from the data.
    needed = (name for each in model.responses for name in (each.output, each.input))
    for name in dict.fromkeys(needed):
        require_match(name, data.units[name], model.units[name])


def check_start(model: GreyBoxModel, selected: Sequence[SelectedResponse]) -> list[Finding]:
    """Look at the model's start values beside the data.

    Raises
    ------
    FitError
        The model has no response of a pair.
    """
    looked: list[Start] = []
    try:
        starts = start_curves(model, [each.omega_rad_s for each in selected])
    except DataError:
        return []  # no value at the start: the search will say so if no start has one
    for each, start, seen, sound in zip(selected, starts, *looks_of(starts), strict=True):
        if not seen:
            raise FitError(
                f"the model has no response of {each.name}",
                found="zero at every frequency with the start values",
                needed="a path from this input to this output",
                action="leave the pair out, or start its parameters away from zero",
            )
        if sound:
            looked.append(Start(each.name, each.omega_rad_s, each.response, start))
    return check_setups(looked)


def _minimise(
    model: GreyBoxModel,
    selected: Sequence[SelectedResponse],
    errors: ErrorModel,
    options: FrequencyDomainOptions,
) -> list[DenseEnd]:
    return minimise(
        model,
        selected,
        errors,
        starts=options.starts,
        seed=options.seed,
        cost=options.cost,
        maximum_iterations=options.maximum_iterations,
    )


def _sensitivity(
    selected: Sequence[SelectedResponse],
    errors: ErrorModel,
    options: FrequencyDomainOptions,
    curves: Curves,
) -> Sensitivity | None:
    """Derivatives of the minimised residuals with respect to the measured points.

    `curves` are what the points are compared with.
    """
    if not errors.runs:
        return None
    if options.cost == "likelihood":
        return PointSensitivity.of([-matrix for *_, matrix in whitening(errors)])
    return coherence_sensitivity(selected, curves, errors)


def compare_responses(
    fitted: GreyBoxModel, selected: Sequence[SelectedResponse]
) -> tuple[FittedResponse, ...]:
    """Measured and fitted responses side by side, each with its cost J."""
    curves = curves_of(fitted, [each.measured.omega_rad_s for each in selected])
    points = [curve[each.places] for each, curve in zip(selected, curves, strict=True)]
    ratio = np.concatenate(points) / np.concatenate([each.response for each in selected])
    weight_db = np.concatenate([each.weight_db for each in selected])
    weight_deg = np.concatenate([each.weight_deg for each in selected])
    missed = weight_db * (DECIBEL * np.log(np.abs(ratio))) ** 2
    missed += weight_deg * (DEGREE * np.angle(ratio)) ** 2
    first = np.cumsum([0, *map(len, points)])[:-1]
    costs = np.add.reduceat(missed, first).tolist()
    return tuple(
        FittedResponse(each.name, cost, each.measured, each.omega_rad_s, curve)
        for each, cost, curve in zip(selected, costs, curves, strict=True)
    )


def band_of(responses: Sequence[FittedResponse]) -> tuple[float, float]:
    """Lowest and highest frequency of any of them, rad/s."""
    lows, highs = zip(*(each.band_rad_s for each in responses), strict=True)
    return min(lows), max(highs)


def _assemble(
    fitted: GreyBoxModel,
    options: FrequencyDomainOptions,
    data: FrequencyResponse,
    groups: Sequence[Sequence[DenseEnd]],
    responses: tuple[FittedResponse, ...],
    found: Statistics,
    setup: list[Finding],
    noise: Mapping[str, NoiseCost],
) -> Fit:
    best = groups[0][0]
    costs = {each.name: each.cost for each in responses}
    total = sum(costs.values())
    free = [parameter.name for parameter in fitted.parameters.free]
    findings = (
        *setup,
        *judge_search(groups),
        *judge_cost(costs, total / len(costs), noise),
        *judge_parameters(found.parameters),
        *judge_correlation(found.names, found.correlation, found.parameters),
        *(
            ()
            if found.withheld
            else judge_intervals(
                found.source,
                outputs_apart=found.outputs_apart,
                noise_taken_for_known=found.noise_taken_for_known,
            )
        ),
    )
    minima = local_minima(groups, free)
    return Fit(
        model=fitted,
        parameters=found.parameters,
        cost=total,
        average_cost=total / len(costs),
        costs=costs,
        names=found.names,
        covariance=found.covariance,
        correlation=found.correlation,
        responses=responses,
        minima=minima,
        objective=best.cost,
        termination=best.termination,
        iterations=best.iterations,
        intervals_from=found.source,
        findings=findings,
        provenance=_provenance(data, options),
        agreement=found.agreement,
    )


def _provenance(data: FrequencyResponse, options: FrequencyDomainOptions) -> dict[str, object]:
    return {
        "method": "frequency domain",
        "flightid": VERSION,
        "data_history": [str(step) for step in data.history],
        "options": options.to_dict(),
    }
