"""Fits of polynomial models to records (native side: `polynomial_fit.rs`)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.findings import Finding
from flightid.identification.black_box import (
    COLOURED,
    WHITE,
    BlackBoxEstimates,
    BlackBoxRuns,
    black_box_fit,
    provenance_of,
)
from flightid.identification.fit import Fit
from flightid.identification.prediction_error.coefficient_covariance import (
    SearchResult,
    compared,
    is_white,
    judged_tests,
    printed,
    shares_poles,
    spent,
    tests_of,
)
from flightid.identification.prediction_error.curved_ends import CurvedEnds, curve_findings
from flightid.identification.prediction_error.details import FitScore, PolynomialDetails
from flightid.identification.prediction_error.excited_inputs import with_excitations
from flightid.identification.prediction_error.findings import (
    CANCELS,
    cancelling,
    judge_polynomial,
)
from flightid.identification.prediction_error.information_criteria import criteria
from flightid.identification.prediction_error.part_blocks import (
    about_levels,
    errors_at,
)
from flightid.identification.prediction_error.roots import (
    coefficients_of,
    fitted_gains,
    fitted_roots,
    without_errors,
)
from flightid.identification.prediction_error.sampling_rate import sampling_findings
from flightid.identification.prediction_error.search import optimum
from flightid.identification.residual_evidence import exact_fit, nothing_told
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.prediction import free_run
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels, gather_channels, hold_diverged
from flightid.record import Record
from flightid.record.several import as_records
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.residual_colour import colour_findings

Array = NDArray[np.float64]


def fit_polynomial(structure: PolynomialStructure, data: Record | Sequence[Record]) -> Fit:
    """Fit a polynomial structure to records; the structure holds all options.

    Reference: Ljung, *System Identification*, 2nd ed., sections 10.2, 10.3, 9.4 and 15.3.
    """
    records = as_records(data)
    channels = gather_channels(records, structure.output, structure.inputs, structure.offsets)
    channels.require_change()
    channels = with_excitations(structure, channels, records)
    (taken, found), choice = optimum(structure, channels)
    return replace(_assemble(taken, records, channels, found, choice), structure=taken)


def _assemble(
    structure: PolynomialStructure,
    records: tuple[Record, ...],
    data: SampledChannels,
    found: SearchResult,
    choice: tuple[Finding, ...],
) -> Fit:
    data = about_levels(structure, data, found.memory, found.theta)
    errors = errors_at(structure, data, found.memory, found.theta)
    counted = tuple(errors[span][found.skip :] for span in data.spans)
    tests = tests_of(structure, data, counted, found)
    found = compared(structure, data, found, errors, tests)
    tests, biased = judged_tests(tests, data, found, errors), shares_poles(structure)
    squares = float(sum(row @ row for row in counted))
    n_counted = sum(row.size for row in counted)
    model = PolynomialModel.from_theta(
        structure,
        found.theta,
        data.sample_time_s,
        noise_variance=squares / found.degrees,
        covariance=found.covariance,
        units=data.units,
        name=f"{structure.kind} model of {structure.output}",
        operating_point=data.operating_point,
    )
    minima = tuple(
        replace(m, objective=squares) if m.objective == 0.0 and found.iterations == 0 else m
        for m in found.minima
    )
    degrees = found.degrees if found.freedom is None else float(np.min(found.freedom))
    roots = fitted_roots(model, degrees)
    pairs = () if structure.kernel else cancelling(model, roots)
    parameters = _parameters(structure, model, found, {pole.response for pole, *_ in pairs})
    runs = _free_runs(model, data)
    return black_box_fit(
        model,
        BlackBoxRuns(
            records,
            tuple(
                (run + offsets[structure.output])[None]
                for run, offsets in zip(runs, data.offsets, strict=True)
            ),
            tuple(row[None] for row in counted),
            # Output error and instruments promise no white errors.
            white=structure.kind != "OE" and structure.method != "iv4",
        ),
        BlackBoxEstimates(
            parameters,
            tuple(name for name, each in parameters.items() if each.stderr is not None),
            printed(found.covariance, parameters),
            WHITE if is_white(structure, tests) else COLOURED,
            found.agreement,
            found.correlations,
        ),
        minima,
        iterations=found.iterations,
        noise_covariance=np.array([[squares / found.degrees]]),
        findings=(
            *choice,
            *judge_polynomial(structure, model, parameters, pairs, minima, n_counted, found.reason),
            *colour_findings(*found.colour, has_bars=found.covariance is not None),
            *tests.findings(biased=biased, times=tests.widening(biased=biased)),
            *_of_bars(found),
            *sampling_findings(model, roots, max(each.duration_s for each in records)),
        ),
        provenance=provenance_of(
            structure.method.replace("_", " "), records, data.offsets, structure.to_dict()
        ),
        details=PolynomialDetails(
            without_errors(roots, [root for pair in pairs for root in pair[:2]], CANCELS),
            fitted_gains(model, degrees),
            criteria(squares, n_counted, structure.n_parameters),
            {structure.output: _scores(structure, runs, data, counted)},
            model.difference_equation(),
            model.factored(),
            spent=spent(structure),
            undetermined=_undetermined(found, parameters),
        ),
    )


def _of_bars(found: SearchResult) -> tuple[Finding, ...]:
    """Why there are no bars, or how the cost bends them."""
    reason = found.reason
    bent = curve_findings(found.reach)
    return (*bent, *nothing_told(reason), *exact_fit(reason))


def _parameters(
    structure: PolynomialStructure,
    model: PolynomialModel,
    found: SearchResult,
    cancelling: Collection[str],
) -> dict[str, Estimate]:
    """Estimates; of responses whose roots cancel, a linear regression alone has Gaussian ones."""
    doubtful = set() if structure.is_regression else coefficients_of(model, cancelling)
    made = {}
    for place, (name, coefficient) in enumerate(model.parameters.items()):
        unit, value = coefficient.unit, float(found.theta[place])
        reason = found.reason if found.covariance is None else ""
        reason = found.noise_reason if not reason and name[0] in "cd" else reason
        reason = reason or (CANCELS if place in doubtful else "")
        if found.covariance is None or reason:
            made[name] = Estimate(name, value, unit, None, reason, status="free")
            continue
        stderr = float(np.sqrt(found.covariance[place, place]))
        degrees = found.degrees if found.freedom is None else float(found.freedom[place])
        even = Estimate(name, value, unit, stderr, freedom=degrees, status="free")
        made[name] = even
        if found.reach is not None:
            below, above = found.reach[place] / np.mean(found.reach)
            made[name] = replace(even, ends=CurvedEnds(even, float(below), float(above)))
    return made


def _undetermined(found: SearchResult, parameters: Mapping[str, Estimate]) -> str:
    """Why coefficients of the vehicle have no errors, where the others keep theirs."""
    bare = found.covariance is not None and any(p.reason == CANCELS for p in parameters.values())
    return CANCELS if bare else ""


def _free_runs(model: PolynomialModel, data: SampledChannels) -> list[Array]:
    """Free runs through the training records, about their operating points."""
    runs = []
    for span in data.spans:
        run = free_run(model, data.output[span], data.inputs[:, span], initial_state="estimate")
        hold_diverged(run[None])
        runs.append(run)
    return runs


def _scores(
    structure: PolynomialStructure,
    runs: Sequence[Array],
    data: SampledChannels,
    counted: Sequence[Array],
) -> tuple[FitScore, FitScore]:
    """One step with the errors of the fit, and free run, over all records of the fit."""
    about = np.concatenate([data.output[span] - data.output[span].mean() for span in data.spans])
    size = float(np.sqrt(about @ about))
    one_step = np.concatenate(counted)
    free = np.concatenate([data.output[s] - run for s, run in zip(data.spans, runs, strict=True)])
    started = {
        "estimate": "an estimated state",
        "zero": "rest",
        "backcast": "a backcast past",
    }[structure.past]

    def score(words: str, errors: Array) -> FitScore:
        norm = float(np.sqrt(errors @ errors))
        rms = norm / float(np.sqrt(errors.size))
        return FitScore(words, rms, 100.0 * (1.0 - norm / size))

    return (
        score(f"one step ahead from {started}, records of the fit", one_step),
        score("free run from an estimated state, records of the fit", free),
    )
