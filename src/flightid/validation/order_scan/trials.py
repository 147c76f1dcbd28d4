"""Trials of an order scan: structures fitted quickly or one by one, and their free runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flightid import _native
from flightid.errors import DataError, FitError, OptionError
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.identify import identify
from flightid.identification.narx.free_run_choice import LINEAR
from flightid.identification.prediction.predict import predict
from flightid.identification.prediction_error.information_criteria import Criteria, criteria
from flightid.identification.prediction_error.part_blocks import about_levels
from flightid.identification.prediction_error.search import search_polynomial
from flightid.models.model import Model
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.progress import progress, track
from flightid.record import Record
from flightid.simulation.metrics import fit_percent, rms_error
from flightid.validation.order_scan.edges import Structure
from flightid.validation.order_scan.result import MUCH_WORSE, OrderTrial, is_settled, rank_of

LONGEST = 40
ITERATIONS = 40
MADE_LEAN = 200
"""Trials after which errors of the worst are dropped."""


@dataclass(frozen=True, eq=False)
class ScanRecords:
    """Records of the fits and of the free runs, and the first stretch that no score counts, s."""

    fitted: Sequence[Record]
    unseen: Sequence[Record]
    settle_s: float


def trials_of(
    structures: Sequence[Structure],
    data: SampledChannels,
    check: SampledChannels,
    scan: ScanRecords,
) -> list[OrderTrial]:
    """Structures of one kind, fitted to the channels `data` and run through those of `check`."""
    quick = [
        each
        for each in structures
        if isinstance(each, PolynomialStructure) and not (any(each.nf) or each.nd)
    ]
    if quick and len(quick) == len(structures):
        return _native_trials(quick, data, check, scan)
    return _fitted_trials(structures, data, scan)


def _native_trials(
    structures: Sequence[PolynomialStructure],
    data: SampledChannels,
    check: SampledChannels,
    scan: ScanRecords,
) -> list[OrderTrial]:
    start = max(max(s.longest_lag + 1, s.nc) for s in structures)
    shortest = min(*data.lengths, *check.lengths)
    wide = len(data.inputs) + 1
    degree = max(max(s.na, *s.nb, s.nc) for s in structures)
    room = min((shortest - start) // 2, sum(data.lengths) // (4 * wide))
    long = min(20 + 2 * degree, LONGEST, room)
    if long < 1:
        raise DataError(
            "a record is too short for the scan",
            found=f"{shortest} samples",
            needed=f"more than {start + 2}",
            action="scan lower orders or give longer records",
        )
    with progress(None, "Scanning orders"):
        found = _native.scan_polynomials(
            data.output,
            data.inputs,
            list(data.lengths),
            [s.native for s in structures],
            long,
            ITERATIONS,
            data.levels,
        )
    skip = _common_skip(structures)
    n = sum(length - skip for length in data.lengths)
    trials = []
    for structure, each in zip(structures, found, strict=True):
        if each is None:
            trials.append(OrderTrial(structure, None, None, None, None, "collinear regressors"))
            continue
        theta, squares, _, converged = each
        model = PolynomialModel.from_theta(
            structure,
            theta,
            data.sample_time_s,
            units=data.units,
            operating_point=about_levels(structure, data, [], theta).operating_point,
        )
        measures = criteria(squares, n, structure.n_parameters)
        note = "" if converged else "not converged"
        trials.append(_judged(structure, model, measures, scan, note))
        if len(trials) % MADE_LEAN == 0:
            trials = _lean(trials)
    return trials


def _common_skip(structures: Sequence[PolynomialStructure]) -> int:
    """Samples that the native scan leaves out at the start of each record."""
    n_inputs = len(structures[0].inputs)
    spans = [max((s.nb[i] + s.nk[i] for s in structures), default=0) for i in range(n_inputs)]
    return max([*spans, *(s.na for s in structures), *(s.nc for s in structures)])


def _fitted_trials(
    structures: Sequence[Structure], data: SampledChannels, scan: ScanRecords
) -> list[OrderTrial]:
    """Fits one by one, the best kept with its trial; of polynomials that one alone is whole."""
    trials: list[OrderTrial] = []
    best = None
    for structure in track(structures, "Scanning orders"):
        try:
            trial = _fitted_trial(structure, data, scan)
        except (DataError, FitError, OptionError) as error:
            trials.append(OrderTrial(structure, None, None, None, None, str(error)))
            continue
        if best is None or rank_of(trial) < rank_of(trials[best]):
            if best is not None:
                trials[best] = replace(trials[best], fit=None)
            best = len(trials)
        trials.append(trial if best == len(trials) else replace(trial, fit=None))
    while (place := _first_of(trials)) is not None and trials[place].fit is None:
        structure = trials[place].structure
        try:
            whole = identify(structure, list(scan.fitted))
            trials[place] = replace(trials[place], fit=whole)
        except (DataError, FitError, OptionError) as error:
            trials[place] = OrderTrial(structure, None, None, None, None, str(error))
    return trials


def _first_of(trials: Sequence[OrderTrial]) -> int | None:
    """Place of the trial that ranks first; None where none was fitted."""
    places = [place for place, trial in enumerate(trials) if trial.model is not None]
    return min(places, key=lambda place: rank_of(trials[place]), default=None)


def _fitted_trial(structure: Structure, data: SampledChannels, scan: ScanRecords) -> OrderTrial:
    if isinstance(structure, PolynomialStructure):
        model, (measures, white), settled = search_polynomial(structure, data)
        trial = replace(_judged(structure, model, measures, scan), whitened=white)
        return trial if settled else replace(trial, settled=False, note="not converged")
    return _identified_trial(structure, scan)


def _identified_trial(structure: Structure, scan: ScanRecords) -> OrderTrial:
    fit = identify(structure, list(scan.fitted))
    straight = any(finding.code == LINEAR for finding in fit.findings)
    note = "linear: no nonlinear model beats it" if straight else ""
    return _ended(replace(_judged(structure, fit.model, None, scan, note), fit=fit), fit)


def fitted_trials(
    structures: Sequence[Structure], scan: ScanRecords, what: str
) -> list[OrderTrial]:
    """Structures of any kind but polynomials with their fits, judged as those of a scan are.

    Parameters
    ----------
    structures : sequence
    scan : ScanRecords
    what : str
        What is tried, for the line of progress.
    """
    trials: list[OrderTrial] = []
    for structure in track(structures, what):
        try:
            trials.append(_identified_trial(structure, scan))
        except (DataError, FitError, OptionError) as error:
            trials.append(OrderTrial(structure, None, None, None, None, str(error)))
    return trials


def _judged(
    structure: Structure, model: Model, measures: Criteria | None, scan: ScanRecords, note: str = ""
) -> OrderTrial:
    """A trial with its free runs: as `flightid.predict` and `flightid.verify` run models."""
    runs = predict(model, list(scan.unseen), settle_s=scan.settle_s)
    if any(run.diverged_at is not None for run in runs):
        return OrderTrial(structure, model, measures, None, None, "free run diverged")
    pairs = [run.scored(model.outputs[0]) for run in runs]
    measured, predicted = (np.concatenate([pair[side] for pair in pairs]) for side in (0, 1))
    rms = float(rms_error(measured, predicted))
    # A run that all but diverged has errors that single precision does not hold, and is like none.
    held = float(np.max(np.abs(measured - predicted))) < float(np.finfo(np.float32).max)
    errors = tuple(np.subtract(*pair).astype(np.float32) for pair in pairs) if held else ()
    percent = float(fit_percent(measured, predicted))
    return OrderTrial(structure, model, measures, rms, percent, note, errors=errors)


def _lean(trials: Sequence[OrderTrial]) -> list[OrderTrial]:
    """Trials, those without errors that run much worse than the best: thousands fill a memory."""
    least = min((t.free_run_rms for t in trials if t.free_run_rms is not None), default=0.0)
    return [
        replace(t, errors=()) if (t.free_run_rms or 0.0) > MUCH_WORSE * least else t for t in trials
    ]


def _ended(trial: OrderTrial, fit: Fit) -> OrderTrial:
    """The trial, told apart where its fit ended at no minimum."""
    if is_settled(fit):
        return trial
    return replace(trial, settled=False, note=trial.note or f"ended by {fit.termination}")


def fit_of(trial: OrderTrial, records: Sequence[Record]) -> Fit:
    """The full fit of a trial: it starts from the optimum that was ranked and stays with it."""
    if trial.fit is not None:
        return trial.fit
    asked = trial.structure
    if isinstance(asked, PolynomialStructure) and isinstance(trial.model, PolynomialModel):
        asked = replace(asked, start=tuple(map(float, trial.model.theta)), starts=1)
    return identify(asked, list(records))


def delivered(trials: Sequence[OrderTrial], scan: ScanRecords) -> tuple[list[OrderTrial], Fit]:
    """Trials in their final order, and the full fit of the first.

    Where a full fit moves the optimum it is ranked anew, so that the first trial is always the fit
    that is delivered.
    """
    waiting = sorted(trials, key=rank_of)
    made: list[tuple[OrderTrial, Fit]] = []
    failed: list[OrderTrial] = []
    reason = "collinear regressors throughout"
    while waiting and (not made or rank_of(waiting[0]) < min(rank_of(each) for each, _ in made)):
        trial = waiting.pop(0)
        if trial.model is None:
            reason = trial.note or reason
            failed.append(trial)
            continue
        try:
            fit = fit_of(trial, scan.fitted)
        except (DataError, FitError) as error:
            reason = str(error)
            failed.append(replace(trial, free_run_rms=None, fit_percent=None, note=reason))
            continue
        judged = _judged(trial.structure, fit.model, trial.criteria, scan, trial.note)
        judged = replace(judged, whitened=trial.whitened)
        made.append((_ended(judged, fit), fit))
    if not made:
        raise FitError(
            "no structure of the scan could be fitted",
            found=reason,
            action="scan lower orders, or use longer or richer records",
        )
    made.sort(key=lambda each: rank_of(each[0]))
    rest = sorted([each for each, _ in made[1:]] + waiting + failed, key=rank_of)
    ranked = _lean([made[0][0], *(replace(each, fit=None) for each in rest)])
    return ranked, made[0][1]
