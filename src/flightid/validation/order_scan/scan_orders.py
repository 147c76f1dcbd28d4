"""Scan of orders, delays and kinds, ranked by free run on unseen records (`order_scan.rs`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError, FitError, OptionError
from flightid.identification.fit import Fit
from flightid.identification.identify import identify
from flightid.identification.narx.free_run_choice import LINEAR
from flightid.identification.prediction.predict import predict
from flightid.identification.prediction.request import usual_stretch
from flightid.identification.prediction_error.information_criteria import Criteria, criteria
from flightid.identification.prediction_error.part_blocks import about_levels
from flightid.identification.prediction_error.search import search_polynomial
from flightid.models.model import Model
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.orders import ANY, USED, ScanOptions
from flightid.models.polynomial.structure import PolynomialOptions, PolynomialStructure
from flightid.models.sampled.channels import SampledChannels, gather_channels
from flightid.progress import progress, track
from flightid.record import Record
from flightid.record.several import as_records
from flightid.simulation.metrics import fit_percent, rms_error
from flightid.validation.order_scan.every_kind import (
    SEARCHED,
    box_jenkins_of,
    narx_of,
    subspace_of,
)
from flightid.validation.order_scan.result import (
    OrderScan,
    OrderTrial,
    Range,
    Structure,
    is_settled,
    rank_of,
    whole_numbers,
)

Array = NDArray[np.float64]
MOST = 20_000
LONGEST = 40
ITERATIONS = 40


def scan_orders(
    records: Record | Sequence[Record],
    validation: Record | Sequence[Record],
    *,
    inputs: Sequence[str] | None = None,
    outputs: str | None = None,
    kind: str = "armax",
    na: Range = range(1, 5),
    nb: Range = range(1, 5),
    nc: Range = range(1, 4),
    nd: Range = range(1, 3),
    nf: Range = range(1, 5),
    nk: Range = 1,
    **options: Unpack[PolynomialOptions],
) -> OrderScan:
    """Fit all combinations of orders and delays; rank them by free run on records not fitted.

    ARX and ARMAX structures come from one triangle of the largest regressor matrix, ARMAX refined
    by prediction errors from there; OE and BJ are fitted one by one. All are judged on the same
    samples; the start of a free run is solved for on the first tenth of a record alone (NARX
    starts from measured lags), which no score counts, and no mean of it is told. The information
    criteria are shown beside it, and which structure each would take: the smallest value over the
    whole scan, not the first increase.

    Kind "any" ranks ARX, ARMAX and OE of these orders, BJ at the best OE's orders, subspace models
    and NARX of as many lags, each in its own words, by the same free runs over the same samples.

    Parameters
    ----------
    records, validation : Record or sequence of Record
        Records of the fits and of the free runs.
    outputs : str, optional
        Default: the only output.
    inputs : sequence of str, optional
        Default: all inputs.
    kind : {"armax", "arx", "oe", "bj", "any"}
    na, nb, nc, nd, nf, nk : int or iterable of int
        Orders to try, those that the kind has; nb, nf and nk alike for all inputs. OE and BJ of
        several inputs are tried with a denominator in common and with one each, unless
        ``denominators`` says which.
    **options
        Of the fit of the best structure and of OE and BJ fits; see `PolynomialStructure`.

    Returns
    -------
    OrderScan
        Trials, the smallest free-run error first, and the full fit of the best.

    Raises
    ------
    OptionError
        An unknown kind, an empty or too large scan, several outputs.
    DataError
        Constant channels, records shorter than the lags, other sample times.
    FitError
        No structure could be fitted.

    Assumes
    -------
    Validation records with other inputs than those of the fit: on the same record a free run
    still favours large models.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., sections 10.1, 16.4 and 16.5.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]], nk=(2,))
    >>> def fly(seed):
    ...     u, noise = np.random.default_rng(seed).standard_normal((2, 400))
    ...     record = fid.Record.from_arrays(np.arange(400) / 10, inputs={"u": u},
    ...                                     outputs={"y": np.zeros(400)})
    ...     return record.replace({"y": truth.simulate(record) + 0.05 * noise})
    >>> scan = scan_orders(fly(0), fly(1), nk=range(1, 4))
    >>> scan.smallest("bic").structure.nk
    (2,)
    """
    fitted = list(as_records(records))
    unseen = list(as_records(validation))
    if not fitted or not unseen:
        raise OptionError("a scan needs records to fit and records to validate on")
    name, names = _channels(fitted[0], outputs, inputs)
    orders = {"na": na, "nb": nb, "nc": nc, "nd": nd, "nf": nf, "nk": nk}
    ScanOptions(kind=kind)
    asked = {
        each: _structures(each, name, names, orders, options)
        for each in (SEARCHED if kind == ANY else (kind,))
    }
    structures = [structure for group in asked.values() for structure in group]
    offsets = structures[0].offsets
    data = gather_channels(fitted, name, names, offsets)
    data.require_change()
    check = gather_channels(unseen, name, names, offsets)
    if abs(check.sample_time_s / data.sample_time_s - 1.0) > 1e-6:
        raise DataError(
            "records and validation have different sample times",
            found=f"{data.sample_time_s:.6g} and {check.sample_time_s:.6g} s",
            action="resample them with conditioning.resample",
        )
    scan = _Scan(fitted, unseen, _settle_s(structures, unseen))
    trials: list[OrderTrial] = []
    for each, group in asked.items():
        quick = each in ("arx", "armax")
        trials += (
            _native_trials(group, data, check, scan) if quick else _fitted_trials(group, data, scan)
        )
    if kind == ANY:
        trials += _fitted_trials(box_jenkins_of(trials, orders), data, scan)
        trials += _fitted_trials(subspace_of(structures), data, scan)
        trials += _fitted_trials(narx_of(trials, whole_numbers("nb", nb)), data, scan)
    ranked, best = _delivered(trials, scan)
    return OrderScan(
        kind, tuple(ranked), best, tuple(r.name for r in unseen), scan.settle_s, data.units[name]
    )


@dataclass(frozen=True, eq=False)
class _Scan:
    """Records of the fits and of the free runs, and the first stretch that no score counts, s."""

    fitted: Sequence[Record]
    unseen: Sequence[Record]
    settle_s: float


def _channels(
    record: Record, output: str | None, inputs: Sequence[str] | None
) -> tuple[str, tuple[str, ...]]:
    if output is None:
        if len(record.outputs) != 1:
            raise OptionError(
                "the output to model is not said",
                found=", ".join(record.outputs) or "no output",
                needed="output='…'",
            )
        output = record.outputs[0]
    return output, tuple(record.inputs if inputs is None else inputs)


def _structures(
    kind: str,
    output: str,
    inputs: tuple[str, ...],
    orders: dict[str, Range],
    options: PolynomialOptions,
) -> list[PolynomialStructure]:
    used = USED[kind]
    choices = [whole_numbers(name, orders[name]) for name in used]
    count = int(np.prod([len(choice) for choice in choices]))
    if count > MOST:
        raise OptionError(
            "the scan is too large", found=f"{count} structures", needed=f"at most {MOST}"
        )
    made: list[PolynomialStructure] = []
    for values in product(*choices):
        chosen = dict(zip(used, values, strict=True))
        made += PolynomialModel.general(inputs, output, **chosen, **options).alternatives
    return made


def _native_trials(
    structures: Sequence[PolynomialStructure],
    data: SampledChannels,
    check: SampledChannels,
    scan: _Scan,
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
    return trials


def _common_skip(structures: Sequence[PolynomialStructure]) -> int:
    """Samples that the native scan leaves out at the start of each record."""
    n_inputs = len(structures[0].inputs)
    spans = [max((s.nb[i] + s.nk[i] for s in structures), default=0) for i in range(n_inputs)]
    return max([*spans, *(s.na for s in structures), *(s.nc for s in structures)])


def _fitted_trials(
    structures: Sequence[Structure], data: SampledChannels, scan: _Scan
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


def _fitted_trial(structure: Structure, data: SampledChannels, scan: _Scan) -> OrderTrial:
    if isinstance(structure, PolynomialStructure):
        model, measures, settled = search_polynomial(structure, data)
        trial = _judged(structure, model, measures, scan)
        return trial if settled else replace(trial, settled=False, note="not converged")
    fit = identify(structure, list(scan.fitted))
    straight = any(finding.code == LINEAR for finding in fit.findings)
    note = "linear: no nonlinear model beats it" if straight else ""
    return _ended(replace(_judged(structure, fit.model, None, scan, note), fit=fit), fit)


def _judged(
    structure: Structure, model: Model, measures: Criteria | None, scan: _Scan, note: str = ""
) -> OrderTrial:
    """A trial with its free runs: as `flightid.predict` and `flightid.verify` run models."""
    runs = predict(model, list(scan.unseen), settle_s=scan.settle_s)
    if any(run.diverged_at is not None for run in runs):
        return OrderTrial(structure, model, measures, None, None, "free run diverged")
    pairs = [run.scored(model.outputs[0]) for run in runs]
    measured, predicted = (np.concatenate([pair[side] for pair in pairs]) for side in (0, 1))
    rms = float(rms_error(measured, predicted))
    return OrderTrial(
        structure, model, measures, rms, float(fit_percent(measured, predicted)), note
    )


def _ended(trial: OrderTrial, fit: Fit) -> OrderTrial:
    """The trial, told apart where its fit ended at no minimum."""
    if is_settled(fit):
        return trial
    return replace(trial, settled=False, note=trial.note or f"ended by {fit.termination}")


def _settle_s(structures: Sequence[PolynomialStructure], unseen: Sequence[Record]) -> float:
    """One first stretch for all structures, so that all are scored on the same samples, s."""
    most = max(s.na + sum(s.nf) for s in structures)
    shortest = min(record.n_samples for record in unseen)
    return usual_stretch(shortest, most) * unseen[0].sample_time_s


def fit_of(trial: OrderTrial, records: Sequence[Record]) -> Fit:
    """The full fit of a trial: it starts from the optimum that was ranked and stays with it."""
    if trial.fit is not None:
        return trial.fit
    asked = trial.structure
    if isinstance(asked, PolynomialStructure) and isinstance(trial.model, PolynomialModel):
        asked = replace(asked, start=tuple(map(float, trial.model.theta)), starts=1)
    return identify(asked, list(records))


def _delivered(trials: Sequence[OrderTrial], scan: _Scan) -> tuple[list[OrderTrial], Fit]:
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
        made.append((_ended(judged, fit), fit))
    if not made:
        raise FitError(
            "no structure of the scan could be fitted",
            found=reason,
            action="scan lower orders, or use longer or richer records",
        )
    made.sort(key=lambda each: rank_of(each[0]))
    rest = sorted([each for each, _ in made[1:]] + waiting + failed, key=rank_of)
    return [made[0][0], *(replace(each, fit=None) for each in rest)], made[0][1]
