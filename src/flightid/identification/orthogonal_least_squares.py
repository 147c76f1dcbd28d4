"""NARX models by orthogonal least squares (native side: `orthogonal_least_squares.rs`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations_with_replacement, product

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from flightid import _native
from flightid.conventions import Light
from flightid.errors import DataError, FitError, OptionError, SingularError
from flightid.findings import Finding
from flightid.identification.narx_fit import ChosenTerm, NarxFit
from flightid.models.narx import NarxEquation, NarxModel, Scaling
from flightid.models.narx_terms import Term, product_term
from flightid.record import Record

Array = NDArray[np.float64]
MAXIMUM_CANDIDATES = 50_000
# Radial candidates beyond this are computed when they are read instead of being kept.
MAXIMUM_BYTES = 1 << 30


def fit_narx(model: NarxModel, data: Record | Sequence[Record]) -> NarxFit:
    """Choose terms by error reduction and fit them; the linear model of the same lags beside it.

    Reference: Chen, Cowan & Grant, IEEE Trans. Neural Networks 2 (1991), section III.
    """
    records = [data] if isinstance(data, Record) else list(data)
    scaling = _scaling(model, records)
    regressors, target = _regressors(model, scaling, records)
    equation, chosen, collinear = _select(model, scaling, regressors, target)
    baseline = _baseline(model, scaling, regressors, target)
    one_step, _ = _rms(equation, records, 1)
    free, held = _rms(equation, records, "free_run")
    linear_free, _ = _rms(baseline, records, "free_run")
    findings = (
        *_collinear_finding(collinear, len(chosen)),
        *_free_run_findings(free, linear_free, held),
    )
    return NarxFit(equation, baseline, chosen, one_step, free, linear_free, target.size, findings)


def _baseline(model: NarxModel, scaling: Scaling, regressors: Array, target: Array) -> NarxEquation:
    """Linear model with all lags; a lag that is a combination of others is left out."""
    linear = replace(
        model,
        kernel=None,
        degree=1,
        constant=True,
        linear=True,
        stop="terms",
        maximum_terms=len(model.lags) + 1,
    )
    return _select(linear, scaling, regressors, target, force=False)[0]


def _scaling(model: NarxModel, records: Sequence[Record]) -> Scaling:
    mean, deviation, units = {}, {}, {}
    for name in (model.output, *model.inputs):
        samples = np.concatenate([record[name] for record in records])
        mean[name] = float(np.mean(samples))
        deviation[name] = float(np.std(samples, ddof=1))
        units[name] = records[0].unit(name)
        if deviation[name] <= 1e-14 * abs(mean[name]):
            raise DataError(
                f"channel {name!r} is constant",
                found=f"{mean[name]:.6g} throughout",
                needed="a channel that changes",
                action="leave the channel out or choose another record",
            )
    output = np.concatenate([record[model.output] for record in records])
    low, high = (
        float((value - mean[model.output]) / deviation[model.output])
        for value in (output.min(), output.max())
    )
    return Scaling(mean, deviation, units, records[0].sample_time_s, (low, high))


def _regressors(
    model: NarxModel, scaling: Scaling, records: Sequence[Record]
) -> tuple[Array, Array]:
    """Regressor vectors (n_samples, n_lags) and targets of all records, each after its start."""
    start = max(lag.lag for lag in model.lags)
    rows, targets = [], []
    for record in records:
        data = {name: scaling.scaled(record, name) for name in (model.output, *model.inputs)}
        n = record.n_samples
        if n > start:
            rows.append(
                np.array([data[lag.channel][start - lag.lag : n - lag.lag] for lag in model.lags]).T
            )
            targets.append(data[model.output][start:])
    n_samples = sum(len(target) for target in targets)
    least = len(model.lags) + 3
    if n_samples < least:
        raise DataError(
            "too few samples for the lags",
            found=f"{n_samples} after the first {start} of each record",
            needed=f"at least {least}",
            action="give longer records or fewer lags",
        )
    return np.ascontiguousarray(np.concatenate(rows)), np.concatenate(targets)


def _products(model: NarxModel) -> tuple[list[Term], int]:
    """Terms of products, the forced ones first, and how many are forced."""
    lags = model.lags
    forced = [product_term([])] if model.constant else []
    forced += [product_term([lag]) for lag in lags] if model.linear else []
    count = sum(math.comb(len(lags) + d - 1, d) for d in range(2, model.degree + 1))
    _require_few(count, "products of lags", "lower degree or use fewer lags")
    free = [
        product_term(combination)
        for degree in range(2, model.degree + 1)
        for combination in combinations_with_replacement(lags, degree)
    ]
    return forced + free, len(forced)


def _require_few(count: int, what: str, action: str) -> None:
    if count > MAXIMUM_CANDIDATES:
        raise OptionError(
            f"too many {what}", found=count, needed=f"at most {MAXIMUM_CANDIDATES}", action=action
        )


def _centres(model: NarxModel, regressors: Array) -> Array:
    dimension = regressors.shape[1]
    if model.kernel is None:
        return np.empty((0, dimension))
    if model.candidates == "kmeans":
        if model.n_candidates >= len(regressors):
            return regressors
        generator = np.random.default_rng(model.seed)
        centres, label = kmeans2(regressors, model.n_candidates, minit="++", rng=generator)
        return np.ascontiguousarray(centres[np.unique(label)])
    if model.candidates == "grid":
        _require_few(
            model.n_candidates**dimension, "grid centres", "use data points, or fewer levels"
        )
        low, high = regressors.min(axis=0), regressors.max(axis=0)
        levels = [np.linspace(a, b, model.n_candidates) for a, b in zip(low, high, strict=True)]
        return np.array(list(product(*levels)), dtype=np.float64)
    return regressors


def _columns(terms: Sequence[Term], model: NarxModel, regressors: Array) -> Array:
    places = {lag: place for place, lag in enumerate(model.lags)}
    columns = np.ones((len(terms), len(regressors)))
    for row, term in enumerate(terms):
        for lag, power in term.factors:
            columns[row] *= regressors[:, places[lag]] ** power
    return columns


def _select(
    model: NarxModel, scaling: Scaling, regressors: Array, target: Array, *, force: bool = True
) -> tuple[NarxEquation, tuple[ChosenTerm, ...], int]:
    terms, forced = _products(model)
    forced = forced if force else 0
    columns = _columns(terms, model, regressors)
    centres = _centres(model, regressors)
    kernel = model.kernel or "gaussian"
    terms += [Term(f"{kernel} {i + 1}", centre=tuple(c)) for i, c in enumerate(centres.tolist())]
    if not terms:
        raise FitError(
            "the model has no candidate terms",
            needed="constant, linear, degree above 1 or a kernel",
        )
    lazy = 8 * len(centres) * target.size > MAXIMUM_BYTES
    if len(centres) and not lazy:
        radial = _native.radial_columns(regressors, centres, kernel, model.beta)
        columns = np.concatenate([columns, radial.reshape(len(centres), target.size)])
    left = centres if lazy else np.empty((0, regressors.shape[1]))
    try:
        order, reduction, squares, press, weights, factor, collinear = _native.select_terms(
            target,
            columns,
            regressors,
            left,
            kernel,
            model.beta,
            forced,
            model.stop,
            model.goal,
            max(model.maximum_terms, forced),
        )
    except SingularError as error:
        raise FitError(
            "constant and linear terms cannot be told apart in these records",
            found="lags that are combinations of one another",
            action="use a richer input, fewer lags, or linear=False",
        ) from error
    kept = weights.size
    if kept == 0:
        raise FitError(
            "no term explains any of the output", action="allow linear terms or other lags"
        )
    spread = np.linalg.norm(np.linalg.inv(factor.reshape(kept, kept)), axis=1)
    residual = math.sqrt(squares[kept - 1] / (target.size - kept))
    chosen = tuple(
        ChosenTerm(terms[index], *map(float, values))
        for index, values in zip(
            order[:kept],
            zip(weights, residual * spread, reduction, squares, press, strict=False),
            strict=True,
        )
    )
    equation = NarxEquation(
        model, tuple(item.term for item in chosen), tuple(weights.tolist()), scaling
    )
    return equation, chosen, collinear


def _rms(
    equation: NarxEquation, records: Sequence[Record], horizon: int | str
) -> tuple[float, str | None]:
    """Error over all records that are longer than the lags, and where the guard first held it."""
    start = max(lag.lag for lag in equation.model.lags)
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


def _collinear_finding(collinear: int, n_chosen: int) -> tuple[Finding, ...]:
    if collinear <= n_chosen:
        return ()
    return (
        Finding(
            "collinear-candidates",
            Light.AMBER,
            f"{collinear} candidates are combinations of the {n_chosen} chosen terms",
            "reduce the width or degree, or use fewer candidates (k-means)",
        ),
    )


def _free_run_findings(free: float, linear: float, held: str | None) -> tuple[Finding, ...]:
    found = []
    if held is not None:
        found.append(
            Finding(
                "free-run-unstable",
                Light.RED,
                f"the free run left the guarded range ({held}) and was held there",
                "use fewer terms or lags, a wider kernel, or linear terms only",
            )
        )
    if free > linear * (1 + 1e-9):
        found.append(
            Finding(
                "loses-to-linear",
                Light.RED,
                f"in free run on its own training records the model (rms {free:.4g}) is worse than "
                f"the linear model of the same lags (rms {linear:.4g})",
                "use the linear model, or search lags and widths by free-run error",
            )
        )
    return tuple(found)
