"""The stages of one model, each a function of records, settings and earlier results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from flightid.conventions import Light
from flightid.errors import DataError, FlightidError
from flightid.findings import Finding
from flightid.identification import Fit, Reduction, identify, reduce
from flightid.identification.frequency_domain.longer_windows import LongerWindows
from flightid.identification.prediction.predict import output_names
from flightid.identification.reduction.rules import TOTAL_COST_RISE_PERCENT
from flightid.models import GreyBoxModel, Model
from flightid.record import Record
from flightid.responses import CoherentPairs, FrequencyResponse, coherent_pairs, estimate_response
from flightid.study.fit_settings import FitSettings
from flightid.study.identified import ModelFits
from flightid.study.reducing import ReduceSettings
from flightid.study.response_settings import ResponseSettings
from flightid.study.structure_settings import StructureSettings
from flightid.study.structures import fit_structure
from flightid.study.task import Task, narrowed, with_responses
from flightid.validation import (
    Comparison,
    OrderScan,
    ResidualTests,
    SpectrumComparison,
    Verification,
    compare_spectra,
    residual_tests,
    scan_orders,
    verify,
)
from flightid.validation.verification.baseline import baseline_of

Group = Sequence[Record]
"""What a name in a study stands for: one record, or all manoeuvres of a file."""
MUCH_WORSE = 1.5
"""Ratio of mean square errors from which a reduction has cost the model its prediction."""
BASELINE = "linear, same lags"
"""Name of the linear model that stands beside a NARX model."""
NOT_TESTED = "residuals-not-tested"


def flat(groups: Sequence[Group]) -> list[Record]:
    """The records of groups, one after the other."""
    return [record for group in groups for record in group]


def estimate(
    records: Sequence[Group],
    inputs: Sequence[str],
    outputs: Sequence[str],
    band_rad_s: tuple[float, float] | None,
    estimator: str,
    settings: ResponseSettings,
    longer: LongerWindows | None = None,
) -> FrequencyResponse:
    """Frequency responses of one model's records by one estimator; without a band, in all of it."""
    flown = flat(records)
    held = [name for name in outputs if all(name in record for record in flown)]
    asked = {**settings.of_verb(estimator), "band_rad_s": band_rad_s}
    made = partial(estimate_response, flown, inputs=inputs, outputs=held)
    return made(**asked) if longer is None else longer.estimate(made, asked)


def select_coherent(
    response: FrequencyResponse,
    minimum_coherence: float,
    minimum_decades: float,
    unbroken: bool,
    on_samples: bool = False,
) -> CoherentPairs:
    """Which responses are coherent over a band wide enough to fit.

    Parameters
    ----------
    response : FrequencyResponse
    minimum_coherence, minimum_decades : float
    unbroken : bool
        Take each response's widest coherent band without a gap in place of all its frequencies.
    on_samples : bool
        The model is fitted to samples, so that a narrow response is no reason to leave out the
        only inputs that there are: the fit's own evidence judges it.
    """
    found = coherent_pairs(
        response, minimum_coherence=minimum_coherence, minimum_decades=minimum_decades
    )
    if on_samples and not found.names:
        seen = tuple(replace(each, kept=each.band_rad_s is not None) for each in found.pairs)
        found = replace(found, pairs=seen)
    if not unbroken:
        return found
    judged = []
    for pair in found.pairs:
        band = response.shown.pair(*pair.name.split("/")).usable_band(minimum_coherence)
        decades = 0.0 if band is None else math.log10(band[1] / band[0])
        kept = pair.kept and decades >= minimum_decades
        reason = pair.reason if kept or not pair.kept else "no unbroken band is wide enough"
        judged.append(replace(pair, band_rad_s=band, decades=decades, kept=kept, reason=reason))
    return replace(found, pairs=tuple(judged))


def chosen_by(task: Task, coherent: CoherentPairs) -> Task:
    """The model with its coherent responses alone, or a structure with its coherent inputs.

    Raises
    ------
    DataError
        No response of a model with equations is coherent.
    """
    if task.model is None:
        driving = {name.split("/")[1] for name in coherent.names}
        return replace(task, inputs=tuple(name for name in task.inputs if name in driving))
    names = tuple(name for name in coherent.names if name in task.model.response_names)
    if not names:
        raise DataError(
            f"no response of model {task.settings.name!r} is coherent",
            found="; ".join(f"{pair.name}: {pair.reason}" for pair in coherent.pairs),
            needed=f"coherence {coherent.minimum_coherence:g} over "
            f"{coherent.minimum_decades:g} decades",
            action="lower [response] minimum_coherence, or fly the inputs harder",
        )
    return replace(task, model=with_responses(task.model, names))


def fit_equations(
    model: GreyBoxModel,
    sources: Mapping[str, Any],
    settings: FitSettings,
    minimum_coherence: float,
    coherent: CoherentPairs | None,
    reducing: ReduceSettings | None,
) -> ModelFits:
    """Fit a model with equations to the response of each estimator, or to the records.

    Where the study asks for it, the structure is reduced by the data that count; all other
    estimates are then fitted with that structure.

    Parameters
    ----------
    model : TransferFunctionModel or StateSpaceModel
    sources : mapping of str to FrequencyResponse, sequence of Group, or tuple of both
        By estimator or method, what counts first.
    settings : FitSettings
    minimum_coherence : float
        Of the frequencies that a fit of responses takes.
    coherent : CoherentPairs or None
        Bands of the responses, where coherence chose them.
    reducing : ReduceSettings or None
    """
    usual: dict[str, Any] = {"minimum_coherence": minimum_coherence}
    if coherent is not None:
        fitted = set(model.response_names)
        usual["band_rad_s"] = {
            name: band for name, band in coherent.bands.items() if name in fitted
        }
    options = settings.asked(usual if settings.on_responses else {})
    (counts, data), *others = [(name, _data(source)) for name, source in sources.items()]
    reduction = None
    if reducing is None:
        counted = identify(model, data, **options)
    else:
        reduction = _reduced(model, data, options, reducing)
        counted, model = reduction.fit, model.with_fixed(**reduction.dropped)
        if reducing.rough:
            counted = identify(reduction.fit.model, data, **options)
    rest = {name: identify(model, other, **options) for name, other in others}
    return ModelFits({counts: counted, **rest}, reduction)


def _reduced(
    model: GreyBoxModel,
    data: Any,  # noqa: ANN401 - whatever identify takes
    options: Mapping[str, Any],
    reducing: ReduceSettings,
) -> Reduction:
    """The path of the structure, on the data as they are or without what only intervals need."""
    given = dict(options)
    if reducing.rough and isinstance(data, FrequencyResponse):
        data = replace(data, errors=None, linear=None)
        given["correct_bias"] = False
    return reduce(
        identify(model, data, **given),
        data,
        keep=reducing.keep,
        drop=reducing.drop,
        after_rise=reducing.after_rise,
        **vars(reducing.limits),
    )


def _data(source: Any) -> Any:  # noqa: ANN401 - as `identify` takes it
    """Responses as they are, groups of records as one list."""
    if isinstance(source, tuple):
        response, groups = source
        return response, flat(groups)
    return source if isinstance(source, FrequencyResponse) else flat(source)


def fit_without_equations(
    settings: StructureSettings,
    inputs: tuple[str, ...],
    flown: Sequence[Group],
    unseen: Sequence[Group],
    scan: OrderScan | None = None,
) -> ModelFits:
    """Fit a structure to records, or the best of several; nothing where no input is coherent."""
    if not inputs:
        return ModelFits()
    told, ranked = (_channels(each, inputs, settings.outputs) for each in (flown, unseen))
    fit, choice = fit_structure(settings, inputs, told, ranked, scan)
    return ModelFits({fit.method: fit}, choice=choice)


def scan_records(
    kind: str,
    tried: Mapping[str, Any],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    flown: Sequence[Group],
    unseen: Sequence[Group],
) -> OrderScan:
    """Polynomial structures of a kind by free run, before the scan is widened.

    Parameters
    ----------
    kind : str
    tried : mapping of str to object
        Orders to try, and options of the structure.
    inputs, outputs : tuple of str
        Outputs: one.
    flown, unseen : sequence of Group
        Records of the fits, and of the free runs.
    """
    told, ranked = (_channels(each, inputs, outputs) for each in (flown, unseen))
    return scan_orders(told, ranked, kind=kind, inputs=inputs, outputs=outputs[0], **tried)


def _channels(
    groups: Sequence[Group], inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> list[Record]:
    return [narrowed(record, inputs, outputs) for record in flat(groups)]


def check(
    name: str,
    fitted: Fit,
    rivals: Mapping[str, Fit | Model],
    records: Group,
    outputs: Sequence[str],
    options: Mapping[str, Any],
    horizon: int | str,
) -> Verification | Comparison:
    """Predict records that the fit has not seen, beside the rivals where there are any."""
    baseline = baseline_of(fitted)
    beside: dict[str, object] = {} if baseline is None else {BASELINE: baseline}
    beside |= rivals
    held = [output for output in outputs if all(output in record for record in records)]
    asked = {**options, "horizon": horizon}
    try:
        return _beside(name, fitted, beside, records, held, asked)
    except FlightidError:
        able, aside = _able(beside, records, held, asked)
        if not aside:
            raise
    made = _beside(name, fitted, able, records, held, asked)
    return replace(made, findings=(*made.findings, *aside))


def _able(
    rivals: Mapping[str, object], records: Group, held: Sequence[str], asked: Mapping[str, Any]
) -> tuple[dict[str, object], list[Finding]]:
    """Rivals that can answer, and for each other one the reason: it does not end the study."""
    able, aside = dict(rivals), []
    for name, rival in rivals.items():
        try:
            _beside(name, rival, {}, records, held, asked)
        except FlightidError as error:
            del able[name]
            said = f"{name} was not compared: {error}"
            aside.append(Finding("rival-without-answer", Light.UNKNOWN, said))
    return able, aside


def _beside(
    name: str,
    model: object,
    rivals: Mapping[str, object],
    records: Group,
    held: Sequence[str],
    asked: Mapping[str, Any],
) -> Verification | Comparison:
    """A model on records, beside rivals where there are any, on the outputs that all have."""
    everyone = [model, *rivals.values()]
    shared = [each for each in held if all(each in output_names(one) for one in everyone)]
    if not rivals:
        return verify(model, records, outputs=shared or held, **asked)
    names = [name, *rivals]
    return verify(everyone, records, names=names, outputs=shared or held, **asked)


def judge_reduction(
    fitted: Fit, start: Fit, records: Group, outputs: Sequence[str], options: Mapping[str, Any]
) -> Finding:
    """Whether a reduced structure predicts records that no fit has seen as the full one does.

    By the mean square errors of the free run, output by output, in their mean ratio.
    """
    held = [output for output in outputs if all(output in record for record in records)]
    after, before = (
        verify(each, records, outputs=held, horizon="free_run", **options)
        for each in (fitted, start)
    )
    tiny = np.finfo(np.float64).tiny
    squares = [(after.rms_error[name] + tiny) / (before.rms_error[name] + tiny) for name in held]
    ratio = float(np.mean(np.square(squares)))
    said = (
        f"{records[0].name}: mean square error of the reduced model {ratio:.3g} of the full one's"
    )
    if ratio <= 1.0 + TOTAL_COST_RISE_PERCENT / 100.0:
        return Finding("reduction-predicts", Light.GREEN, said)
    light = Light.AMBER if ratio <= MUCH_WORSE else Light.RED
    return Finding("reduction-predicts", light, said, "keep what the prediction needs")


def examine_residuals(fitted: Fit) -> ResidualTests | Finding | None:
    """Residual tests of a fit to records, or why there are none; responses alone have no residuals.

    Records that are too short for a test end no study: what it would have said stays unknown.
    """
    if not fitted.records:
        return None
    try:
        return residual_tests(fitted)
    except DataError as error:
        return _unexamined(NOT_TESTED, "residuals were not tested", error)


def _unexamined(code: str, what: str, error: DataError) -> Finding:
    return Finding(
        code, Light.UNKNOWN, f"{what}, {error.problem}: {error.found}", error.action or ""
    )


def compare_free_run(
    fitted: Fit, records: Group, options: Mapping[str, Any]
) -> SpectrumComparison | Finding:
    """The spectrum of a free run through the first record beside the measured one, or why not.

    The stretch that settles a verification belongs to its own records, not to those of the fit.
    """
    options = {name: value for name, value in options.items() if name != "settle_s"}
    record = records[0]
    held = [output for output in fitted.model.outputs if output in record]
    seen = narrowed(record, fitted.model.inputs, held)
    made = verify(fitted, seen, outputs=held, **options)
    try:
        return compare_spectra(made)
    except DataError as error:
        return _unexamined("spectra-not-compared", "spectra were not compared", error)
