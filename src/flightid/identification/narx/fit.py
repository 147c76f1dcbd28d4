"""NARX models by orthogonal least squares.

Native side: `orthogonal_least_squares.rs`, `local_regularisation.rs`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError, FitError, SingularError
from flightid.frozen import dataclass
from flightid.identification.black_box import (
    BlackBoxEstimates,
    BlackBoxRuns,
    black_box_fit,
    provenance_of,
)
from flightid.identification.fit import Fit
from flightid.identification.innovation_tests import innovation_tests
from flightid.identification.local_minimum import LocalMinimum
from flightid.identification.narx.candidates import (
    CandidateTerms,
    candidate_terms,
    product_columns,
)
from flightid.identification.narx.details import ChosenTerm, NarxDetails
from flightid.identification.narx.findings import collinear_finding, free_run_findings
from flightid.identification.narx.free_run_choice import choose_by_free_run
from flightid.identification.narx.parts import compare_weights
from flightid.identification.narx.regressors import Regressors, regressors_of, scaling_of
from flightid.models.narx.model import NarxModel
from flightid.models.narx.scaling import Scaling
from flightid.models.narx.structure import SIMULATION, NarxStructure
from flightid.record import Record
from flightid.record.several import as_records
from flightid.uncertainty.agreement import AgreementTest
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
# Candidates beyond this in sixteen bits are computed when they are read instead of being kept.
MAXIMUM_BYTES = 1 << 30
OF_FREE_RUNS = "weights minimise errors of free runs: they have no standard errors"
MORE_TERMS = "allow more lags or terms (maximum_terms), check the delay, or look for feedback"


@dataclass(frozen=True, eq=False)
class Selection:
    """Chosen terms, how many candidates are combinations of them, covariance of the weights."""

    chosen: tuple[ChosenTerm, ...]
    collinear: int
    covariance: Array


@dataclass(frozen=True, eq=False)
class NarxRun:
    """A model through a training record: measured and predicted output, and its start."""

    measured: Array
    predicted: Array
    start: int
    diverged_at: int | None

    @classmethod
    def of(cls, model: NarxModel, record: Record, horizon: int | str) -> NarxRun:
        """Run a record so many samples ahead."""
        return cls(record[model.output], *model.run(record, horizon))

    @property
    def scored(self) -> tuple[Array, Array]:
        """Measured and predicted samples after the start."""
        return self.measured[self.start :], self.predicted[self.start :]


def fit_narx(structure: NarxStructure, data: Record | Sequence[Record]) -> Fit:
    """Choose terms by error reduction and fit them; the linear model of the same lags beside it.

    Reference: Chen, Cowan & Grant, IEEE Trans. Neural Networks 2 (1991), section III; penalties:
    Chen, Neurocomputing 69 (2006).
    """
    records = as_records(data)
    scaling = scaling_of(structure, records)
    chosen_on, estimated_on = regressors_of(structure, scaling, records)
    candidates = candidate_terms(structure, chosen_on.vectors)
    selection = _select(structure, candidates, chosen_on)
    collinear = selection.collinear
    if structure.held_back:
        selection = _estimated(structure, selection.chosen, estimated_on)
    chosen = selection.chosen
    model = _model(structure, scaling, chosen)
    baseline = _baseline(structure, scaling, records)
    flown = tuple(record for record in records if record.n_samples > structure.longest_lag)
    made = _Choice(structure, selection, model, baseline, flown, estimated_on, collinear)
    build = _of_simulation if structure.focus == SIMULATION else _of_prediction
    provenance = provenance_of(
        "orthogonal least squares",
        records,
        [scaling.mean] * len(records),
        structure.to_dict(),
    )
    return build(made, provenance)


@dataclass(frozen=True, eq=False)
class _Choice:
    """What the choice of terms hands over, with the linear model and the records to run."""

    structure: NarxStructure
    selection: Selection
    model: NarxModel
    baseline: NarxModel
    flown: tuple[Record, ...]
    data: Regressors
    collinear: int

    def runs(self, model: NarxModel, horizon: int | str) -> list[NarxRun]:
        """The model through every record."""
        return [NarxRun.of(model, record, horizon) for record in self.flown]

    def inputs_of(self, errors: Sequence[Array]) -> list[Array]:
        """Inputs beside the errors of each record."""
        return [
            record.matrix(self.structure.inputs)[:, -row.shape[1] :]
            for record, row in zip(self.flown, errors, strict=True)
        ]


def _of_simulation(made: _Choice, provenance: dict[str, object]) -> Fit:
    """Weights, width, centres and number of terms by free runs; the linear model where it wins."""
    structure = made.structure
    found = choose_by_free_run(made.model, made.baseline, made.flown)
    free, linear = (made.runs(each, "free_run") for each in (found.model, found.linear))
    errors = tuple(np.subtract(*run.scored)[None] for run in free)
    known = {item.term.name: item for item in made.selection.chosen}
    pairs = list(zip(found.model.terms, found.model.weights, strict=True))
    chosen = tuple(
        replace(known[term.name], term=term, weight=weight)
        if term.name in known
        else ChosenTerm(term, weight, 0.0, 0.0, 0.0, 0.0)
        for term, weight in pairs
    )
    details = NarxDetails(
        found.linear,
        chosen,
        _rms(made.runs(found.model, 1)),
        _rms(free),
        _rms(linear),
        made.data.target.size,
        made.model.scaling.units[structure.output],
        OF_FREE_RUNS,
    )
    weights = {term.name: weight for term, weight in pairs}
    tests = innovation_tests(
        errors,
        made.inputs_of(errors),
        [run.measured[None] for run in free],
        (structure.output_lags, structure.input_lags),
    )
    squares = sum(float(np.sum(row**2)) for row in errors)
    return black_box_fit(
        found.model,
        BlackBoxRuns(made.flown, tuple(run.predicted[None] for run in free), errors, white=False),
        BlackBoxEstimates(_parameters(structure, chosen, None, OF_FREE_RUNS), tuple(weights), None),
        (LocalMinimum(found.sum_of_squares, 1, weights, found.termination),),
        iterations=found.iterations,
        noise_covariance=np.array([[squares / max(details.n_samples - len(chosen), 1)]]),
        findings=(
            *found.findings,
            *free_run_findings(
                _judged(structure, free), _judged(structure, linear), _held(made.flown, free)
            ),
            *tests.findings(biased=False, action=MORE_TERMS),
        ),
        provenance=provenance,
        details=details,
    )


def _of_prediction(made: _Choice, provenance: dict[str, object]) -> Fit:
    """Weights by least squares one step ahead."""
    structure, selection, chosen = made.structure, made.selection, made.selection.chosen
    agreed = compare_weights(structure, chosen, made.data, selection.covariance)
    one_step, free = made.runs(made.model, 1), made.runs(made.model, "free_run")
    linear = made.runs(made.baseline, "free_run")
    errors = tuple(np.subtract(*run.scored)[None] for run in one_step)
    squares = sum(float(np.sum(row**2)) for row in errors)
    weights = {item.term.name: item.weight for item in chosen}
    tests = innovation_tests(
        errors,
        made.inputs_of(errors),
        [run.measured[None] for run in one_step],
        (structure.output_lags, structure.input_lags),
    ).beside(None if agreed is None else agreed.agreement)
    details = NarxDetails(
        made.baseline,
        chosen,
        _rms(one_step),
        _rms(free),
        _rms(linear),
        made.data.target.size,
        made.model.scaling.units[structure.output],
        tests.why_biased,
    )
    covariance = None
    if structure.held_back and not tests.why_biased:
        covariance = _covariance(selection, agreed)
    return black_box_fit(
        made.model,
        BlackBoxRuns(made.flown, tuple(run.predicted[None] for run in free), errors),
        BlackBoxEstimates(
            _parameters(structure, chosen, agreed, tests.why_biased),
            tuple(weights),
            covariance,
            agreement=None if agreed is None else agreed.agreement,
        ),
        (LocalMinimum(chosen[-1].sum_of_squares, 1, weights, structure.stop),),
        iterations=len(chosen),
        noise_covariance=np.array([[squares / max(details.n_samples - len(chosen), 1)]]),
        findings=(
            *collinear_finding(made.collinear, len(chosen)),
            *free_run_findings(
                _judged(structure, free), _judged(structure, linear), _held(made.flown, free)
            ),
            *tests.findings(biased=True),
        ),
        provenance=provenance,
        details=details,
    )


def _covariance(selection: Selection, agreed: AgreementTest | None) -> Array:
    return selection.covariance if agreed is None else agreed.covariance


def _parameters(
    structure: NarxStructure,
    chosen: Sequence[ChosenTerm],
    agreed: AgreementTest | None,
    why_biased: str,
) -> dict[str, Estimate]:
    """Weights by term; errors hold in spite of the choice only where samples were held back."""
    held = structure.held_back > 0.0 and not why_biased
    if held and agreed is not None and agreed.agreement.by_scatter is not None:
        errors = np.sqrt(np.diag(agreed.covariance))
        known = zip(chosen, errors.tolist(), agreed.freedom.tolist(), strict=True)
        return {
            item.term.name: Estimate(
                item.term.name, item.weight, "1", error, freedom=freedom, status="free"
            )
            for item, error, freedom in known
        }
    if held:
        return {
            item.term.name: Estimate(item.term.name, item.weight, "1", item.stderr, status="free")
            for item in chosen
        }
    reason = why_biased or "standard errors ignore the choice of terms: see held_back"
    return {
        item.term.name: Estimate(item.term.name, item.weight, "1", None, reason, status="free")
        for item in chosen
    }


def _baseline(model: NarxStructure, scaling: Scaling, records: Sequence[Record]) -> NarxModel:
    """Linear model with all lags, its weights from the samples that the other's come from.

    Combinations of other lags are left out.
    """
    linear = replace(
        model,
        kernel=None,
        degree=1,
        constant=True,
        linear=True,
        stop="terms",
        maximum_terms=len(model.lags) + 1,
        regularisation="none",
        penalty=0.0,
    )
    _, data = regressors_of(linear, scaling, records)
    candidates = replace(candidate_terms(linear, data.vectors), forced=0)
    return _model(linear, scaling, _select(linear, candidates, data).chosen)


def _model(structure: NarxStructure, scaling: Scaling, chosen: Sequence[ChosenTerm]) -> NarxModel:
    terms = tuple(item.term for item in chosen)
    weights = tuple(item.weight for item in chosen)
    return NarxModel(structure, terms, weights, scaling, f"NARX model of {structure.output}")


def _estimated(model: NarxStructure, chosen: Sequence[ChosenTerm], data: Regressors) -> Selection:
    """Weights of chosen terms by least squares on samples that took no part in the choice."""
    products = tuple(item.term for item in chosen if not item.term.centre)
    radial = tuple(item.term for item in chosen if item.term.centre)
    if data.target.size <= len(chosen):
        raise DataError(
            "too few samples are held back for the chosen terms",
            found=data.target.size,
            needed=f"more than {len(chosen)}",
            action="hold back a larger share, or choose fewer terms",
        )
    everything = CandidateTerms(products, radial, len(chosen))
    plain = replace(model, stop="terms", maximum_terms=len(chosen))
    return _select(plain, everything, data)


def _select(model: NarxStructure, candidates: CandidateTerms, data: Regressors) -> Selection:
    target, forced = data.target, candidates.forced
    try:
        order, reduction, squares, press, weights, penalties, factor, collinear = (
            _native.select_terms(
                target,
                product_columns(candidates.products, model, data.vectors),
                data.vectors,
                candidates.centres(data.vectors.shape[1]),
                model.kernel or "gaussian",
                model.beta,
                2 * len(candidates.terms) * target.size <= MAXIMUM_BYTES,
                forced,
                model.stop,
                model.goal,
                max(model.maximum_terms, forced),
                model.regularisation,
                model.penalty,
            )
        )
    except SingularError as error:
        raise FitError(
            "terms that are always kept cannot be told apart in these records",
            found="lags that are combinations of one another",
            action="use a richer input, fewer lags, or linear=False",
        ) from error
    kept = weights.size
    if kept == 0:
        raise FitError(
            "no term explains any of the output", action="allow linear terms or other lags"
        )
    # No output is known better than its rounding, however exactly terms may give it.
    rounding = float(np.finfo(float).eps) ** 2 * float(target @ target)
    left = max(float(squares[kept - 1]), rounding)
    spread = _spread(factor.reshape(kept, kept), penalties, left, target.size)
    errors = np.linalg.norm(spread, axis=1)
    terms = candidates.terms
    columns = (weights, errors, reduction, squares, press, penalties)
    chosen = tuple(
        ChosenTerm(terms[index], *map(float, values))
        for index, values in zip(order[:kept], zip(*columns, strict=False), strict=True)
    )
    return Selection(chosen, collinear, spread @ spread.T)


def _spread(factor: Array, penalties: Array, squares: float, n: int) -> Array:
    """L with covariance L Lᵀ of the weights in white noise; with penalties Bayes' posterior."""
    lengths = np.diag(factor) ** 2
    determined = lengths / (lengths + penalties)
    residual = math.sqrt(squares / (n - float(np.sum(determined))))
    return np.asarray(residual * (np.linalg.inv(factor) * np.sqrt(determined)))


def _rms(runs: Sequence[NarxRun]) -> float:
    """Error over all records after the lags."""
    errors = np.concatenate([np.subtract(*run.scored) for run in runs])
    return float(np.sqrt(np.mean(errors**2)))


def _judged(structure: NarxStructure, runs: Sequence[NarxRun]) -> list[Array]:
    """Errors of free runs by record: before the part held back, which gave the weights."""
    errors = [np.subtract(*run.scored) for run in runs]
    return [row[: row.size - round(structure.held_back * row.size)] for row in errors]


def _held(records: Sequence[Record], runs: Sequence[NarxRun]) -> str | None:
    """Where the guard first held a run."""
    for record, run in zip(records, runs, strict=True):
        if run.diverged_at is not None:
            return f"record {record.name!r}, sample {run.diverged_at}"
    return None
