"""Fits of polynomial models to records (native side: `polynomial_fit.rs`)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError, FitError
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
from flightid.identification.local_minimum import LocalMinimum
from flightid.identification.prediction_error.backcast import backcast
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
from flightid.identification.prediction_error.denominators import preferred
from flightid.identification.prediction_error.details import FitScore, PolynomialDetails
from flightid.identification.prediction_error.findings import (
    CANCELS,
    cancelling,
    judge_polynomial,
)
from flightid.identification.prediction_error.information_criteria import criteria
from flightid.identification.prediction_error.instrumental_variables import four_stage
from flightid.identification.prediction_error.kernel_regression import kernel_estimate
from flightid.identification.prediction_error.linear_regression import (
    inverse_square,
    regress_structure,
    require_independent,
)
from flightid.identification.prediction_error.part_blocks import (
    BEFORE,
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
from flightid.identification.prediction_error.starts import polynomial_starts
from flightid.identification.residual_evidence import nothing_told
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.prediction import free_run
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels, gather_channels, hold_diverged
from flightid.record import Record
from flightid.record.several import as_records
from flightid.uncertainty.coloured_residuals import colour_findings
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
BACKCASTS = 6
SETTLED = 1e-6
SAME_MINIMUM = 1e-6
SPARE_SAMPLES = 3


def fit_polynomial(structure: PolynomialStructure, data: Record | Sequence[Record]) -> Fit:
    """Fit a polynomial structure to records; the structure holds all options.

    Reference: Ljung, *System Identification*, 2nd ed., sections 10.2, 10.3, 9.4 and 15.3.
    """
    records = as_records(data)
    channels = gather_channels(records, structure.output, structure.inputs, structure.offsets)
    channels.require_change()
    ends, problem = [], None
    for each in structure.alternatives:
        try:
            _require_samples(each, channels)
            ends.append((each, _search(each, channels)))
        except (DataError, FitError) as error:
            problem = error
    if problem is not None and not ends:
        raise problem
    (structure, found), choice = preferred(ends, channels)
    return replace(_assemble(structure, records, channels, found, choice), structure=structure)


def _require_samples(structure: PolynomialStructure, data: SampledChannels) -> None:
    lag = structure.longest_lag
    counted = sum(max(0, n - lag) for n in data.lengths)
    least = structure.n_parameters + SPARE_SAMPLES
    if counted < least or min(data.lengths) <= lag:
        raise DataError(
            "too few samples for the orders",
            found=f"{counted} after the first {lag} of each record, the shortest record with "
            f"{min(data.lengths)}",
            needed=f"at least {least}, each record longer than {lag}",
            action="give longer records or lower orders",
        )


def _search(structure: PolynomialStructure, data: SampledChannels) -> SearchResult:
    if structure.is_regression and not structure.backcast:
        found = _regression(structure, data)
        unstable = np.max(np.abs(np.roots([1.0, *found.theta[: structure.na]])), initial=0.0) >= 1.0
        if not (structure.enforce_stability and unstable):
            return found
    if structure.backcast:
        return _backcast_rounds(structure, data)
    return _iterate(structure, data, polynomial_starts(structure, data), [])


def _regression(structure: PolynomialStructure, data: SampledChannels) -> SearchResult:
    """ARX: linear in the coefficients, so no iteration."""
    skip = 0 if structure.initial_state == "zero" else structure.longest_lag
    made = regress_structure(structure, data, skip)
    degrees = made.n_rows - made.theta.size
    if structure.kernel is not None:
        smooth = kernel_estimate(made, (structure.na, *structure.nb), structure.kernel)
        return _linear(structure, smooth.theta, smooth.covariance, degrees, "kernel", skip)
    require_independent(made, structure)
    if structure.method == "iv4":
        theta, known = four_stage(structure, data)
        found = _linear(structure, theta, known.covariance, degrees, "instruments", skip)
        return replace(found, freedom=known.freedom, colour=known.colour, agreement=known.agreement)
    covariance = made.sum_of_squares / degrees * inverse_square(made.factor)
    return _linear(structure, made.theta, covariance, degrees, "regression", skip)


def _linear(
    structure: PolynomialStructure,
    theta: Array,
    covariance: Array,
    degrees: int,
    ending: str,
    skip: int,
) -> SearchResult:
    values = dict(zip(structure.names, theta.tolist(), strict=True))
    minimum = LocalMinimum(0.0, 1, values, ending)
    return SearchResult(theta, covariance, degrees, (minimum,), 0, [], skip)


def _iterate(
    structure: PolynomialStructure,
    data: SampledChannels,
    starts: Array,
    memory: list[list[float]],
) -> SearchResult:
    """Gauss-Newton with the damping of Levenberg and Marquardt from every start."""
    skip = structure.longest_lag if structure.is_regression and not memory else 0
    outcomes = _native.polynomial_fit(
        data.output,
        data.inputs,
        list(data.lengths),
        structure.native,
        starts,
        BEFORE[structure.past],
        memory,
        data.levels,
        skip,
        structure.enforce_stability,
        structure.maximum_iterations,
    )
    ends = [end for end in outcomes if not isinstance(end, str) and np.isfinite(end[1])]
    if not ends:
        raise FitError(
            "the fit diverged from every start",
            found="; ".join(sorted({end for end in outcomes if isinstance(end, str)})),
            action="lower the orders, or give more starts",
        )
    ends.sort(key=lambda end: end[1])
    theta, squares, flat, iterations, _ = ends[0]
    unknown = len(data.lengths) * data.levels
    if structure.past == "estimate":
        of_inputs, of_noise = _native.polynomial_memory(structure.native)
        unknown += len(data.lengths) * (sum(of_inputs) + of_noise)
    if structure.is_regression:
        unknown = len(data.lengths) * (skip + data.levels)
    degrees = max(data.output.size - unknown - theta.size, 1)
    factor = flat.reshape(theta.size, theta.size).T
    covariance = None
    if _is_determined(factor):
        covariance = squares / degrees * inverse_square(factor)
    return SearchResult(
        theta, covariance, degrees, _minima(structure, ends), iterations, memory, skip
    )


def _is_determined(factor: Array) -> bool:
    lengths = np.linalg.norm(factor, axis=0)
    return bool(np.all(np.abs(np.diag(factor)) > 1e-11 * np.maximum(lengths, 1e-300)))


def _minima(
    structure: PolynomialStructure, ends: Sequence[tuple[Array, float, Array, int, str]]
) -> tuple[LocalMinimum, ...]:
    groups: list[LocalMinimum] = []
    for theta, squares, _, _, ending in ends:
        if groups and squares <= groups[-1].objective * (1 + SAME_MINIMUM):
            groups[-1] = replace(groups[-1], count=groups[-1].count + 1)
        else:
            values = dict(zip(structure.names, theta.tolist(), strict=True))
            groups.append(LocalMinimum(squares, 1, values, ending))
    return tuple(groups)


def _backcast_rounds(structure: PolynomialStructure, data: SampledChannels) -> SearchResult:
    """The past follows from the model and the model from the past, until both rest."""
    of_inputs, of_noise = _native.polynomial_memory(structure.native)
    memory = [[0.0] * (sum(of_inputs) + of_noise) for _ in data.lengths]
    starts = polynomial_starts(structure, data)
    found = _iterate(structure, data, starts, memory)
    for _ in range(BACKCASTS):
        model = PolynomialModel.from_theta(structure, found.theta, data.sample_time_s)
        about = about_levels(structure, data, found.memory, found.theta)
        after = _iterate(structure, data, found.theta[None], backcast(model, about))
        moved = np.abs(after.theta - found.theta)
        found = replace(after, minima=(*after.minima[:1], *found.minima[1:]))
        if found.covariance is None or np.all(
            moved <= SETTLED * np.sqrt(np.diag(found.covariance))
        ):
            break
    return found


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
    tests = tests_of(structure, data, counted, found.skip)
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
            *nothing_told(found.reason),
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
        ),
    )


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
        made[name] = Estimate(name, value, unit, stderr, freedom=degrees, status="free")
    return made


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
