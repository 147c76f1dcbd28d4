"""Fits of innovations models to records: subspace estimate, order, refinement."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from flightid.identification.prediction_error.result import FitScore
from flightid.identification.prediction_error.roots import Errors
from flightid.identification.subspace.data import SubspaceData, gather
from flightid.identification.subspace.estimate import Matrices, decompose
from flightid.identification.subspace.findings import judge_innovations
from flightid.identification.subspace.order import OrderChoice, choose_order, determinant_criteria
from flightid.identification.subspace.prediction_errors import Refined, refine
from flightid.identification.subspace.result import InnovationsFit
from flightid.identification.subspace.roots import innovations_gains, innovations_roots
from flightid.models.innovations.model import InnovationsModel
from flightid.models.innovations.prediction import one_step_errors
from flightid.models.innovations.structure import SubspaceStructure
from flightid.record import Record
from flightid.version import VERSION

Array = NDArray[np.float64]


def fit_subspace(structure: SubspaceStructure, data: Record | Sequence[Record]) -> InnovationsFit:
    """Fit an innovations model to records; the structure holds all options.

    Reference: Ljung, *System Identification*, 2nd ed., sections 10.6 and 7.3.
    """
    records = (data,) if isinstance(data, Record) else tuple(data)
    gathered = gather(structure, records)
    choice, start = choose_order(structure, gathered, decompose(structure, gathered))
    size = gathered.scales
    if structure.refine:
        found = refine(
            gathered,
            _scaled(start, 1.0 / size),
            direct=structure.direct,
            initial_state=structure.initial_state,
            maximum_iterations=structure.maximum_iterations,
        )
    else:
        found = _unrefined(structure, gathered, _scaled(start, 1.0 / size))
    return _assemble(structure, records, gathered, choice, found)


def _scaled(matrices: Matrices, size: Array) -> Matrices:
    """The model with its outputs multiplied by `size`."""
    a, b, c, d, k = matrices
    return a, b, size[:, None] * c, size[:, None] * d, k / size


def _unrefined(structure: SubspaceStructure, data: SubspaceData, start: Matrices) -> Refined:
    model = InnovationsModel(structure.outputs, structure.inputs, 1.0, *start)
    errors = tuple(
        one_step_errors(model, y, u, structure.initial_state)
        for y, u in zip(data.outputs, data.inputs, strict=True)
    )
    samples = sum(e.size for e in errors)
    degrees = max(samples - structure.n_parameters(model.order), 1)
    return Refined(start, errors, None, degrees, 0, "subspace")


def _assemble(
    structure: SubspaceStructure,
    records: tuple[Record, ...],
    data: SubspaceData,
    choice: OrderChoice,
    found: Refined,
) -> InnovationsFit:
    size = data.scales
    errors = tuple(size[:, None] * e for e in found.errors)
    joint = np.hstack(errors)
    model = InnovationsModel(
        structure.outputs,
        structure.inputs,
        data.channels.sample_time_s,
        *_scaled(found.matrices, size),
        noise_covariance=joint @ joint.T * (len(size) / found.degrees),
        units=data.channels.units,
        operating_point=data.channels.operating_point,
        name=f"innovations model of {', '.join(structure.outputs)}",
    )
    covariance = _in_units(structure, found, size)
    spread = Errors(model.sample_time_s, covariance, found.degrees)
    roots = innovations_roots(model, spread, direct=structure.direct)
    measures = determinant_criteria(joint, size[:, None], structure.n_parameters(model.order))
    scores = _scores(structure, model, records, errors)
    return InnovationsFit(
        model,
        structure,
        choice,
        roots,
        innovations_gains(model, spread, direct=structure.direct),
        covariance,
        measures,
        scores,
        records,
        errors,
        found.termination,
        found.iterations,
        judge_innovations(structure, model, choice, roots, found.termination),
        _provenance(structure, records, data),
    )


def _in_units(structure: SubspaceStructure, found: Refined, size: Array) -> Array | None:
    if found.covariance is None:
        return None
    a, b, c, d, k = (np.ones_like(matrix) for matrix in found.matrices)
    parts = [a, b, size[:, None] * c, size[:, None] * d, k / size]
    if not structure.direct:
        del parts[3]
    factor = np.concatenate([part.ravel() for part in parts])
    return np.asarray(factor[:, None] * found.covariance * factor)


def _scores(
    structure: SubspaceStructure,
    model: InnovationsModel,
    records: Sequence[Record],
    errors: Sequence[Array],
) -> dict[str, tuple[FitScore, FitScore]]:
    runs = [model.predict(record, "free_run", offsets=structure.offsets) for record in records]
    free = np.hstack([run.residual for run in runs])
    step = np.hstack(list(errors))
    started = "rest" if structure.initial_state == "zero" else "an estimated state"
    found = {}
    for place, name in enumerate(structure.outputs):
        about = np.concatenate([record[name] - record[name].mean() for record in records])
        size = float(np.linalg.norm(about))

        def score(words: str, row: Array, size: float = size) -> FitScore:
            norm = float(np.linalg.norm(row))
            return FitScore(words, norm / float(np.sqrt(row.size)), 100.0 * (1.0 - norm / size))

        found[name] = (
            score(f"{name} one step ahead from {started}, records of the fit", step[place]),
            score(f"{name} {runs[0].words}, records of the fit", free[place]),
        )
    return found


def _provenance(
    structure: SubspaceStructure, records: Sequence[Record], data: SubspaceData
) -> dict[str, object]:
    digest = hashlib.sha256(data.channels.output.tobytes())
    digest.update(np.ascontiguousarray(data.channels.inputs).tobytes())
    options = asdict(structure)
    return {
        "method": structure.method,
        "flightid": VERSION,
        "data_sha256": digest.hexdigest(),
        "data_history": [str(step) for record in records for step in record.history],
        "records": [record.name for record in records],
        "offsets": [dict(row) for row in data.channels.offsets],
        "options": {key: options[key] for key in options if key not in ("outputs", "inputs")},
    }
