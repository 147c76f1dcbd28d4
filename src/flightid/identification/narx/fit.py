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
from flightid.identification.narx.candidates import (
    CandidateTerms,
    candidate_terms,
    product_columns,
)
from flightid.identification.narx.findings import collinear_finding, free_run_findings
from flightid.identification.narx.regressors import Regressors, regressors_of, scaling_of
from flightid.identification.narx.result import ChosenTerm, NarxFit
from flightid.models.narx.model import NarxModel
from flightid.models.narx.scaling import Scaling
from flightid.models.narx.structure import NarxStructure
from flightid.record import Record

Array = NDArray[np.float64]
# Radial candidates beyond this are computed when they are read instead of being kept.
MAXIMUM_BYTES = 1 << 30


def fit_narx(model: NarxStructure, data: Record | Sequence[Record]) -> NarxFit:
    """Choose terms by error reduction and fit them; the linear model of the same lags beside it.

    Reference: Chen, Cowan & Grant, IEEE Trans. Neural Networks 2 (1991), section III; penalties:
    Chen, Neurocomputing 69 (2006).
    """
    records = [data] if isinstance(data, Record) else list(data)
    scaling = scaling_of(model, records)
    chosen_on, estimated_on = regressors_of(model, scaling, records)
    candidates = candidate_terms(model, chosen_on.vectors)
    chosen, collinear = _select(model, candidates, chosen_on)
    if model.held_back:
        chosen = _estimated(model, chosen, estimated_on)
    equation = _equation(model, scaling, chosen)
    baseline = _baseline(model, scaling, records)
    one_step, _ = _rms(equation, records, 1)
    free, held = _rms(equation, records, "free_run")
    linear_free, _ = _rms(baseline, records, "free_run")
    findings = (
        *collinear_finding(collinear, len(chosen)),
        *free_run_findings(free, linear_free, held),
    )
    n_samples = estimated_on.target.size
    return NarxFit(equation, baseline, chosen, one_step, free, linear_free, n_samples, findings)


def _baseline(model: NarxStructure, scaling: Scaling, records: Sequence[Record]) -> NarxModel:
    """Linear model with all lags on all samples; combinations of other lags are left out."""
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
        held_back=0.0,
    )
    data, _ = regressors_of(linear, scaling, records)
    candidates = replace(candidate_terms(linear, data.vectors), forced=0)
    return _equation(linear, scaling, _select(linear, candidates, data)[0])


def _equation(model: NarxStructure, scaling: Scaling, chosen: Sequence[ChosenTerm]) -> NarxModel:
    terms = tuple(item.term for item in chosen)
    return NarxModel(model, terms, tuple(item.weight for item in chosen), scaling)


def _estimated(
    model: NarxStructure, chosen: Sequence[ChosenTerm], data: Regressors
) -> tuple[ChosenTerm, ...]:
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
    return _select(plain, everything, data)[0]


def _select(
    model: NarxStructure, candidates: CandidateTerms, data: Regressors
) -> tuple[tuple[ChosenTerm, ...], int]:
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
                8 * len(candidates.radial) * target.size <= MAXIMUM_BYTES,
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
    errors = _standard_errors(factor.reshape(kept, kept), penalties, squares[kept - 1], target.size)
    terms = candidates.terms
    columns = (weights, errors, reduction, squares, press, penalties)
    chosen = tuple(
        ChosenTerm(terms[index], *map(float, values))
        for index, values in zip(order[:kept], zip(*columns, strict=False), strict=True)
    )
    return chosen, collinear


def _standard_errors(factor: Array, penalties: Array, squares: float, n: int) -> Array:
    """Standard errors of the weights in white noise; with penalties those of Bayes' posterior."""
    lengths = np.diag(factor) ** 2
    determined = lengths / (lengths + penalties)
    residual = math.sqrt(squares / (n - float(np.sum(determined))))
    spread: Array = residual * np.linalg.norm(np.linalg.inv(factor) * np.sqrt(determined), axis=1)
    return spread


def _rms(
    equation: NarxModel, records: Sequence[Record], horizon: int | str
) -> tuple[float, str | None]:
    """Error over all records that are longer than the lags, and where the guard first held it."""
    start = max(lag.lag for lag in equation.structure.lags)
    runs = [
        (record.name, equation.predict(record, horizon))
        for record in records
        if record.n_samples > start
    ]
    errors = np.concatenate([np.subtract(*run.scored) for _, run in runs])
    held = next(
        (
            f"record {name!r}, sample {run.diverged_at}"
            for name, run in runs
            if run.diverged_at is not None
        ),
        None,
    )
    return float(np.sqrt(np.mean(errors**2))), held
