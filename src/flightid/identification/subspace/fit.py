"""Fits of innovations models to records: subspace estimate, order, refinement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.identification.black_box import (
    BlackBoxEstimates,
    BlackBoxRuns,
    black_box_fit,
    provenance_of,
)
from flightid.identification.fit import Fit
from flightid.identification.innovation_tests import innovation_tests
from flightid.identification.local_minimum import LocalMinimum
from flightid.identification.prediction_error.details import FitScore
from flightid.identification.prediction_error.roots import Errors
from flightid.identification.prediction_error.sampling_rate import sampling_findings
from flightid.identification.subspace.data import SubspaceData, acts_at_once, gather
from flightid.identification.subspace.details import SubspaceDetails
from flightid.identification.subspace.estimate import Matrices, decompose
from flightid.identification.subspace.findings import PREDICTOR_AT_CIRCLE, judge_innovations
from flightid.identification.subspace.order import OrderChoice, choose_order, determinant_criteria
from flightid.identification.subspace.prediction_errors import (
    Predictor,
    RefinementResult,
    whitener,
)
from flightid.identification.subspace.refined_order import refined_order, scaled
from flightid.identification.subspace.roots import (
    innovations_gains,
    innovations_roots,
    may_reach_circle,
)
from flightid.models.innovations.model import InnovationsModel
from flightid.models.innovations.prediction import free_run
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.sampled.channels import hold_diverged
from flightid.record import Record
from flightid.record.several import as_records
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]


def fit_subspace(structure: SubspaceStructure, data: Record | Sequence[Record]) -> Fit:
    """Fit an innovations model to records; the structure holds all options.

    Reference: Ljung, *System Identification*, 2nd ed., sections 10.6 and 7.3.
    """
    records = as_records(data)
    gathered = gather(structure, records)
    if structure.direct is None:
        structure = replace(structure, direct=acts_at_once(gathered, gathered.horizon(structure)))
    decomposed = decompose(structure, gathered)
    choice, start, limit = choose_order(structure, gathered, decomposed)
    if structure.refine:
        choice, found, spare = refined_order(
            structure, gathered, decomposed, (choice, limit), start
        )
    else:
        found, spare = _unrefined(structure, gathered, scaled(start, 1.0 / gathered.scales)), ""
    return _assemble(structure, records, gathered, choice, found, spare)


def _unrefined(
    structure: SubspaceStructure, data: SubspaceData, start: Matrices
) -> RefinementResult:
    errors = _predictor(structure, data, start).fitted_errors(start, np.eye(data.n_outputs))
    samples = sum(e.size for e in errors)
    degrees = max(samples - structure.n_parameters(len(start[0])), 1)
    return RefinementResult(start, errors, None, degrees, 0, "subspace")


def _predictor(structure: SubspaceStructure, data: SubspaceData, matrices: Matrices) -> Predictor:
    direct, start = bool(structure.direct), structure.initial_state
    return Predictor.of(data, matrices, direct=direct, initial_state=start)


def _assemble(
    structure: SubspaceStructure,
    records: tuple[Record, ...],
    data: SubspaceData,
    choice: OrderChoice,
    found: RefinementResult,
    spare: str,
) -> Fit:
    size = data.scales
    if data.channels.levels:
        predictor = _predictor(structure, data, found.matrices)
        data = data.about(predictor.levels(found.matrices, whitener(found.errors)))
    errors = tuple(size[:, None] * e for e in found.errors)
    joint = np.hstack(errors)
    model = InnovationsModel(
        structure.inputs,
        structure.outputs,
        data.channels.sample_time_s,
        *scaled(found.matrices, size),
        noise_covariance=joint @ joint.T * (len(size) / found.degrees),
        units=data.channels.units,
        operating_point=data.channels.operating_point,
        name=f"innovations model of {', '.join(structure.outputs)}",
    )
    spent = (2 * model.order, model.order)
    tests = innovation_tests(found.errors, data.inputs, data.outputs, spent)
    times = None if spare else tests.widening(biased=True)
    covariance = None if times is None else _in_units(structure, found, size, times)
    direct = bool(structure.direct)
    plain = _in_units(structure, found, size, 1.0)
    at_circle = plain is not None and may_reach_circle(model, plain, direct=direct)
    covariance = None if at_circle else covariance
    spread = Errors(model.sample_time_s, covariance, found.degrees)
    roots = innovations_roots(model, spread, direct=direct)
    measures = determinant_criteria(joint, size[:, None], structure.n_parameters(model.order))
    runs = _free_runs(model, data)
    parameters = _parameters(model)
    values = {name: item.value for name, item in parameters.items()}
    names = [name for name in parameters if structure.direct or not name.startswith("d")]
    return black_box_fit(
        model,
        BlackBoxRuns(records, _about(structure, data, runs), errors),
        BlackBoxEstimates(parameters, tuple(names), covariance, agreement=found.agreement),
        (LocalMinimum(measures.loss, 1, values, found.termination),),
        iterations=found.iterations,
        noise_covariance=np.asarray(model.noise_covariance),
        findings=(
            *judge_innovations(
                structure, model, choice, roots, found.termination, spare, at_circle
            ),
            *tests.findings(biased=True, times=times),
            *sampling_findings(model, roots, max(record.duration_s for record in records)),
        ),
        provenance=provenance_of(
            structure.method, records, data.channels.offsets, structure.to_dict()
        ),
        details=SubspaceDetails(
            roots,
            innovations_gains(model, spread, direct=bool(structure.direct)),
            measures,
            _scores(structure, data, runs, errors),
            repr(choice),
            # Poles and gains of the predictor shape each correlation; input matrices the other.
            spent=spent,
            undetermined=PREDICTOR_AT_CIRCLE if at_circle else "",
            order=choice,
        ),
    )


def _parameters(model: InnovationsModel) -> dict[str, Estimate]:
    """Entries of the matrices, without intervals: they turn with the choice of states."""
    reason = "states are free to turn: see poles, zeros and gains"
    return {
        name: Estimate(name, float(item.value or 0.0), item.unit, None, reason, status="free")
        for name, item in model.parameters.items()
    }


def _in_units(
    structure: SubspaceStructure, found: RefinementResult, size: Array, times: float
) -> Array | None:
    """Covariance in the outputs' units, of standard errors so many times as long."""
    if found.covariance is None:
        return None
    a, b, c, d, k = (np.ones_like(matrix) for matrix in found.matrices)
    parts = [a, b, size[:, None] * c, size[:, None] * d, k / size]
    if not structure.direct:
        del parts[3]
    factor = times * np.concatenate([part.ravel() for part in parts])
    return np.asarray(factor[:, None] * found.covariance * factor)


def _free_runs(model: InnovationsModel, data: SubspaceData) -> list[Array]:
    """Free runs through the training records, about their operating points."""
    runs = []
    with np.errstate(over="ignore", invalid="ignore"):
        for y, u in zip(data.outputs, data.inputs, strict=True):
            run = free_run(model, data.scales[:, None] * y, u, initial_state="estimate")
            hold_diverged(run)
            runs.append(run)
    return runs


def _about(
    structure: SubspaceStructure, data: SubspaceData, runs: Sequence[Array]
) -> tuple[Array, ...]:
    """Runs in the units of the outputs, what was taken off put on again."""
    return tuple(
        run + np.array([[offsets[name]] for name in structure.outputs])
        for run, offsets in zip(runs, data.channels.offsets, strict=True)
    )


def _scores(
    structure: SubspaceStructure,
    data: SubspaceData,
    runs: Sequence[Array],
    errors: Sequence[Array],
) -> dict[str, tuple[FitScore, FitScore]]:
    measured = [data.scales[:, None] * y for y in data.outputs]
    free = np.hstack([y - run for y, run in zip(measured, runs, strict=True)])
    step = np.hstack(list(errors))
    started = "rest" if structure.initial_state == "zero" else "an estimated state"
    found = {}
    for place, name in enumerate(structure.outputs):
        about = np.concatenate([y[place] - y[place].mean() for y in measured])
        size = float(np.linalg.norm(about))

        def score(words: str, row: Array, size: float = size) -> FitScore:
            norm = float(np.linalg.norm(row))
            return FitScore(words, norm / float(np.sqrt(row.size)), 100.0 * (1.0 - norm / size))

        found[name] = (
            score(f"{name} one step ahead from {started}, records of the fit", step[place]),
            score(f"{name} free run from an estimated state, records of the fit", free[place]),
        )
    return found
