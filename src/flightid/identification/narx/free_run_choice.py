"""How many chosen terms run freely best, their weights by errors of free runs; else linear.

Terms come one step ahead, in the order in which they explain most. Ever more of them are fitted to
free runs over the first part of each record and judged by free runs over the rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import FitError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.narx.findings import loses
from flightid.identification.narx.simulation_error import (
    Run,
    SimulationError,
    lag_vectors,
    term_columns,
)
from flightid.models.narx.model import NarxModel
from flightid.models.narx.terms import Term
from flightid.record import Record

Array = NDArray[np.float64]
LINEAR = "linear-delivered"
KEPT = 0.3
"""Share of each record, at its end, that judges how many terms there are."""
PATIENCE = 2
"""Further sizes that are tried after the best."""
STEPS = 30
MOST_SAMPLES = 20_000
"""Of all records, on which sizes are compared; the size that is taken is fitted to all."""


@dataclass(frozen=True, eq=False)
class FreeRunFit:
    """A model fitted to free runs, and how it came about.

    Attributes
    ----------
    model : NarxModel
    linear : NarxModel
        The linear model of the same lags, fitted in the same way.
    sum_of_squares : float
        Of the scaled errors in free run over all records.
    iterations : int
    termination : str
    findings : tuple of Finding
    """

    model: NarxModel
    linear: NarxModel
    sum_of_squares: float
    iterations: int
    termination: str
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A model, its mean square error over what was held back, and whether its centres moved."""

    model: NarxModel
    error: float
    centres: bool = False


def choose_by_free_run(
    model: NarxModel, baseline: NarxModel, records: Sequence[Record]
) -> FreeRunFit:
    """Fit ever more terms of a model to free runs and take those that run best over the rest.

    Parameters
    ----------
    model : NarxModel
        Its terms in the order of choice, the linear ones first.
    baseline : NarxModel
        Linear model of the same lags.
    records : sequence of Record
        Longer than the lags.

    Raises
    ------
    FitError
        No model stays inside its guard in free run.

    Reference
    ---------
    Piroddi & Spinelli, "An identification algorithm for polynomial NARX models based on simulation
    error minimization", *Int. J. Control* 76 (2003).
    """
    runs = [_scaled(model, record) for record in records]
    told, kept = _parts(runs, model.structure.longest_lag)
    linear = _fitted(baseline, [baseline], told, kept)
    tried: list[_Candidate] = [] if linear is None else [linear]
    best, since = linear, 0
    for size in _sizes(model, baseline):
        last = tried[-1].model if tried else None
        found = _fitted(size, [size, *_grown(size, last)], told, kept)
        if found is None:
            continue
        tried.append(found)
        better = best is None or found.error < best.error
        best, since = (found, 0) if better else (best, since + 1)
        if since >= PATIENCE:
            break
    if linear is not None and best is not None and not _beats(best.model, linear.model, kept):
        best = linear
    if best is None:
        raise FitError(
            "no model stays in range in free run",
            found="growth beyond the guard for every number of terms",
            needed="one that runs freely",
            action="give other lags, or records of a stable motion",
        )
    final = SimulationError(best.model, runs, best.centres)
    fitted, squares, iterations, termination = final.minimised(STEPS)
    ended = "cost" if not np.isfinite(squares) else termination
    if not np.isfinite(squares):
        fitted = best.model
    straight = fitted
    if best is not linear:
        straight = baseline if linear is None else _refitted(linear.model, runs)
    return FreeRunFit(
        fitted, straight, squares, iterations, ended, _said(best, linear, model, len(tried))
    )


def _scaled(model: NarxModel, record: Record) -> Run:
    rows = [model.scaling.scaled(record, name) for name in (model.output, *model.inputs)]
    return rows[0], np.array(rows[1:]).reshape(len(model.inputs), record.n_samples)


def _parts(runs: Sequence[Run], lag: int) -> tuple[list[Run], list[Run]]:
    """The first part of each run, and the rest with the lags before it."""
    told, kept = [], []
    share = min(1.0, MOST_SAMPLES / sum(output.size for output, _ in runs))
    for output, inputs in runs:
        n = max(round(share * output.size), min(output.size, 4 * (lag + 1)))
        cut = round((1.0 - KEPT) * n)
        if cut > 2 * lag:
            told.append((output[:cut], np.ascontiguousarray(inputs[:, :cut])))
        if n - cut > lag:
            span = slice(cut - lag, n)
            kept.append((output[span], np.ascontiguousarray(inputs[:, span])))
    return told or list(runs), kept or list(runs)


def _sizes(model: NarxModel, baseline: NarxModel) -> Iterator[NarxModel]:
    """The first terms of the model: those that the linear one has, then 1, 2, 4, … more, all."""
    linear = {term.name for term in baseline.terms}
    first = sum(term.name in linear for term in model.terms)
    counts, more = [], 1
    while first + more < len(model.terms):
        counts.append(first + more)
        more *= 2
    for count in [*counts, len(model.terms)] if len(model.terms) > first else []:
        yield replace(model, terms=model.terms[:count], weights=model.weights[:count])


def _grown(model: NarxModel, last: NarxModel | None) -> list[NarxModel]:
    """The model with the values that fewer terms ended with, and none of the others."""
    if last is None:
        return []
    known: dict[str, tuple[Term, float]] = {
        term.name: (term, weight) for term, weight in zip(last.terms, last.weights, strict=True)
    }
    terms = tuple(known[term.name][0] if term.name in known else term for term in model.terms)
    weights = tuple(known[term.name][1] if term.name in known else 0.0 for term in model.terms)
    structure = last.structure if any(term.centre for term in last.terms) else model.structure
    return [replace(model, structure=structure, terms=terms, weights=weights)]


def _fitted(
    model: NarxModel, starts: Sequence[NarxModel], told: list[Run], kept: list[Run]
) -> _Candidate | None:
    """The best of what weights alone, then centres too, make of free runs; None: all grow."""
    errors = [(_error(each, told), place) for place, each in enumerate(starts)]
    errors.append((_error(one_step := _one_step(model, told), told), len(starts)))
    least, place = min(errors)
    if not np.isfinite(least):
        return None
    found, *_ = SimulationError([*starts, one_step][place], told).minimised(STEPS)
    tried = [_Candidate(found, _error(found, kept))]
    if any(term.centre for term in found.terms):
        moved, *_ = SimulationError(found, told, centres=True).minimised(STEPS)
        tried.append(_Candidate(moved, _error(moved, kept), centres=True))
    best = min(tried, key=lambda each: each.error)
    return best if np.isfinite(best.error) else None


def _one_step(model: NarxModel, runs: Sequence[Run]) -> NarxModel:
    """The model with the weights of least squares one step ahead."""
    start = model.structure.longest_lag
    columns = [term_columns(model, lag_vectors(model, y, u, start)).T for y, u in runs]
    target = np.concatenate([y[start:] for y, _ in runs])
    weights = np.linalg.lstsq(np.concatenate(columns), target, rcond=None)[0]
    return replace(model, weights=tuple(weights.tolist()))


def _beats(model: NarxModel, linear: NarxModel, runs: Sequence[Run]) -> bool:
    """Whether free runs of a model err less than the linear one's by more than chance."""
    pairs = []
    for each in (linear, model):
        error = SimulationError(each, runs)
        pairs.append(np.split(error.residuals(error.start), np.cumsum(error.counts)[:-1]))
    return loses(*pairs)


def _refitted(model: NarxModel, runs: Sequence[Run]) -> NarxModel:
    found, squares, *_ = SimulationError(model, runs).minimised(STEPS)
    return found if np.isfinite(squares) else model


def _error(model: NarxModel, runs: Sequence[Run]) -> float:
    """Mean square error of free runs; infinite where the guard held one."""
    error = SimulationError(model, runs)
    left = error.residuals(error.start)
    return float(left @ left) / left.size if np.all(np.isfinite(left)) else np.inf


def _said(
    best: _Candidate, linear: _Candidate | None, model: NarxModel, n_tried: int
) -> tuple[Finding, ...]:
    share = f"free run over the last {100 * KEPT:.0f} % of each record"
    unit, size = model.scaling.units[model.output], model.scaling.deviation[model.output]
    shown = f"rms {size * np.sqrt(best.error):.4g} {unit}".rstrip()
    if best is linear:
        return (
            Finding(
                LINEAR,
                Light.AMBER,
                f"in {share} no nonlinear model that was tried beats the linear one ({shown}) by "
                "more than chance: the linear one is delivered",
                "fit a linear kind (ARX to BJ, subspace), whose estimates have intervals",
            ),
        )
    beside = (
        "which the linear model left"
        if linear is None
        else f"linear {size * np.sqrt(linear.error):.4g}"
    )
    words = f"{len(best.model.terms)} terms of {n_tried} sizes tried run best in {share}"
    return (Finding("terms-by-free-run", Light.GREEN, f"{words}: {shown}, {beside}"),)
