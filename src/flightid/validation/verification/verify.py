"""The verb `verify`: predict records that a model has not seen, and judge how well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, overload

import numpy as np

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import Finding
from flightid.identification.prediction.continuous import is_whole, predict_continuous
from flightid.identification.prediction.predict import (
    Predictor,
    output_names,
    outputs_held,
    predictor_of,
    require_units,
)
from flightid.identification.prediction.remembered import of_record, remembered, start_of_runs
from flightid.identification.prediction.request import FREE_RUN, Request
from flightid.identification.prediction.result import Prediction
from flightid.identification.records.options import InitialState
from flightid.record import Record
from flightid.record.chosen_hold import ASSUMED, chosen_hold
from flightid.record.hold import HOLDS, InputHold
from flightid.record.several import as_records
from flightid.responses import FrequencyResponse
from flightid.threads import on_one_thread
from flightid.validation.verification.baseline import baseline_findings
from flightid.validation.verification.beyond_noise import foretold_findings
from flightid.validation.verification.by_excitation import unexcused
from flightid.validation.verification.comparison import Comparison, compared
from flightid.validation.verification.contradiction import contradictions
from flightid.validation.verification.held_otherwise import hold_findings
from flightid.validation.verification.judgement import THEIL_GUIDE, judge
from flightid.validation.verification.muad import mismatch
from flightid.validation.verification.of_the_fit import (
    fit_findings,
    gust_errors,
    own_errors,
    seen_findings,
)
from flightid.validation.verification.parameter_findings import refuted_findings
from flightid.validation.verification.pieces import growth_findings
from flightid.validation.verification.refuted_parameters import questioned
from flightid.validation.verification.result import Verification


@overload
def verify(  # type: ignore[overload-overlap]  # a list is an object too
    source: list[object] | tuple[object, ...],
    records: Record | Sequence[Record],
    *,
    names: Sequence[str] | None = ...,
    horizon: int | str = ...,
    initial_state: InitialState | None = ...,
    settle_s: float | None = ...,
    state_bias: bool | None = ...,
    output_bias: bool | None = ...,
    outputs: Sequence[str] | None = ...,
    hold: InputHold | None = ...,
    responses: FrequencyResponse | None = ...,
) -> Comparison: ...


@overload
def verify(
    source: object,
    records: Record | Sequence[Record],
    *,
    names: None = ...,
    horizon: int | str = ...,
    initial_state: InitialState | None = ...,
    settle_s: float | None = ...,
    state_bias: bool | None = ...,
    output_bias: bool | None = ...,
    outputs: Sequence[str] | None = ...,
    hold: InputHold | None = ...,
    responses: FrequencyResponse | None = ...,
) -> Verification: ...


@on_one_thread
def verify(
    source: object,
    records: Record | Sequence[Record],
    *,
    names: Sequence[str] | None = None,
    horizon: int | str = FREE_RUN,
    initial_state: InitialState | None = None,
    settle_s: float | None = None,
    state_bias: bool | None = None,
    output_bias: bool | None = None,
    outputs: Sequence[str] | None = None,
    hold: InputHold | None = None,
    responses: FrequencyResponse | None = None,
) -> Verification | Comparison:
    """Predict records with a model, or with several of any kinds side by side, and judge it.

    Models in continuous time, ``dx/dt = A x + B (u - u_ref) + b``, ``y = C x + D (u - u_ref) +
    y_ref``: a free run over the whole record. Nothing of the model changes; state biases b, output
    biases y_ref and the initial state are solved for by
    weighted least squares in each record, since they belong to the record. u_ref is the record's
    declared trim, or zero. The equations of a nonlinear model are integrated instead, on the
    channels as they are; ``state_bias=True`` solves for a constant shift
    of each of its inputs, which is never done unasked. Sampled models (ARX …
    Box–Jenkins, innovations forms, NARX) run about the operating point of their training records,
    from a state that a first stretch tells, which no score counts; no bias is taken off.

    Assumes: records that were not used in the fit, and that start in trim where
    ``initial_state="trim"`` holds the initial state there; a nonlinear model that does not explode
    within a record. Start and biases are solved for on the first third of a record: over the whole
    of it they would imitate slow modes. Modes that grow a hundredfold over a record are run
    backward from its end, which is exact for records of any length; that explains rather than
    predicts, and the light comes from pieces of the record. An error that inputs do not foretell
    is that of gusts and noise, and never red.

    Parameters
    ----------
    source : Fit or model, or list or tuple of them
        Of any kind. Of several the first is on trial and the others are its rivals; samples that
        tell the start of one of them are scored for none.
    records : Record or sequence of Record
        What to predict; they hold the models' inputs and outputs by name and unit.
    names : sequence of str, optional
        Names of several models; default: their own.
    horizon : int or "free_run"
        Samples ahead, for models that predict from the measured past; see `flightid.predict`.
    initial_state : {"trim", "zero", "measured", "estimate"} or mapping, optional
        Where runs start; default: one rule for all methods, see `flightid.predict`.
    settle_s : float, optional
        First stretch, s, on which start and biases are solved for and which no score counts; 0 is
        the whole record, scored. Default: a third, scored.
    state_bias, output_bias : bool, optional
        Solve for state biases b and output biases y_ref; default: as the fit was told of
        `input_bias` and `output_bias`, else for models in continuous time (b: linear ones).
    outputs : sequence of str, optional
        Outputs to compare; default: those of the models that every record holds.
    hold : {"first", "zero", "band_limited"}, optional
        What inputs do between samples; default: what the records know, else what the fit was told,
        else "first", and a finding says so.
    responses : FrequencyResponse, optional
        Measured responses: the models are judged against them too, inside the envelopes of
        maximum unnoticed added dynamics (see `flightid.validation.mismatch`).

    Returns
    -------
    Verification, or Comparison for several models

    Raises
    ------
    ModelError
        The model cannot be simulated.
    OptionError
        No record, or an option that is not known or that the kind of model does not have.
    UnknownNameError
        A record lacks an input, or none of the outputs.
    UnitError
        A unit of the model and one of a record differ.
    DataError
        The free run diverges, an output does not change, or records hold inputs differently.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., chapter 14; Ljung,
    System Identification, 2nd ed., section 16.5.

    Example
    -------
    >>> import numpy as np
    >>> from flightid.models.linear.linear_system import LinearSystem
    >>> from flightid.simulation.simulate import simulate
    >>> time_s = np.arange(500) * 0.02
    >>> lag = LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> truth = simulate(lag, Record.from_arrays(time_s, inputs={"u": np.sign(np.sin(time_s))}))
    >>> slower = LinearSystem([[-1.6]], [[1.6]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> result = verify(slower, truth.replace({"y": truth["y"] + 5.0}))
    >>> 0.02 < result.theil["y"] < 0.06
    True
    """
    flown = as_records(records)
    if not flown:
        raise OptionError("there is nothing to verify on", needed="one record or more")
    several = source if isinstance(source, list | tuple) else [source]
    models = [predictor_of(each) for each in several]
    chosen = _compared([model for model, _ in models], flown, outputs)
    _require_change(flown, chosen)
    holds = [
        chosen_hold(flown, hold, known=HOLDS, fitted=remembered(each).hold) for each in several
    ]
    wanted = Request(horizon, initial_state, settle_s, bool(state_bias), bool(output_bias))
    told = (state_bias is not None, output_bias is not None)
    requests = [
        _request(each, model, way, replace(wanted, hold=held.hold), told)
        for each, (model, way), held in zip(several, models, holds, strict=True)
    ]
    for model, _ in models:
        for record in flown:
            require_units(model, record, chosen)
    ways = [
        partial(_run, each, model, way, chosen)
        for each, (model, way) in zip(several, models, strict=True)
    ]
    runs = [run(request, flown) for run, request in zip(ways, requests, strict=True)]
    results = []
    for each, (model, way), run, request, made, held in zip(
        several, models, ways, requests, _scored_alike(runs), holds, strict=True
    ):
        seen = None if responses is None else mismatch(model, responses)
        own = own_errors(each, THEIL_GUIDE[0])
        gusts = gust_errors(each, model, [record.duration_s for record in flown])
        asked = questioned(each, way, made, request)
        judged = judge(tuple(made), chosen, request, seen, own, gusts, asked)
        beside = (
            *baseline_findings(each, made, request),
            *contradictions(each, way, made, request, asked),
            *growth_findings(made, partial(run, request), asked),
        )
        beside = (
            *beside,
            *refuted_findings(
                asked.refuted, (*judged.findings, *beside), hold_known=held.source != ASSUMED
            ),
        )
        if all(each.light is Light.GREEN for each in (*judged.findings, *beside)):
            beside = (*beside, *foretold_findings(made, unexcused(made, chosen), asked.innovations))
        in_time = way is predict_continuous
        taken = remembered(each).assumed_hold
        again = partial(run, records=flown)
        said = hold_findings(held, judged, request, taken, again) if in_time else ()
        known = (*seen_findings(each, flown, chosen), *fit_findings(each))
        said = (*known, *said, *_at_mean(each, flown))
        between = judged.hold if in_time else None
        results.append(replace(judged, hold=between, findings=(*judged.findings, *beside, *said)))
    if not isinstance(source, list | tuple):
        return results[0]
    return compared(dict(zip(_names(several, names), results, strict=True)))


def _run(
    source: object,
    model: object,
    way: Predictor,
    outputs: tuple[str, ...],
    request: Request,
    records: tuple[Record, ...],
) -> list[Prediction]:
    return [way(of_record(source, model, each), each, outputs, request) for each in records]


def _request(
    source: object, model: object, way: Predictor, asked: Request, told: tuple[bool, bool]
) -> Request:
    """What is solved for: as told here, else as the fit was told, else by the kind of model."""
    if way is not predict_continuous:
        return asked
    known = remembered(source)
    # Linear models hold about the record's own trim, which no training told; equations of whole
    # channels have none, and a shift of every input would make other inputs of the measured ones.
    state = not is_whole(model) if known.input_bias is None else known.input_bias
    output = True if known.output_bias is None else known.output_bias
    return replace(
        asked,
        initial_state=start_of_runs(source, asked.initial_state),
        state_bias=asked.state_bias if told[0] else state,
        output_bias=asked.output_bias if told[1] else output,
    )


def _at_mean(source: object, records: tuple[Record, ...]) -> tuple[Finding, ...]:
    """Say which parameters a fit estimated for each of its records, which no other record has."""
    names = remembered(source).record_parameters
    unknown = [name for name in names if not all(name in record for record in records)]
    if not unknown:
        return ()
    return (
        Finding(
            "verification-record-parameters",
            Light.UNKNOWN,
            f"{', '.join(unknown)}: estimated in each record of the fit, here the mean of those",
            "give the records a channel of that name, or judge with output_bias=True",
        ),
    )


def _scored_alike(runs: list[list[Prediction]]) -> list[list[Prediction]]:
    """The same samples of a record count for every model."""
    starts = [max(made[place].start for made in runs) for place in range(len(runs[0]))]
    return [
        [replace(one, start=start) for one, start in zip(made, starts, strict=True)]
        for made in runs
    ]


def _names(models: Sequence[Any], given: Sequence[str] | None) -> list[str]:
    if len(models) < 2:
        raise OptionError("there is nothing to compare", found=len(models), needed="two models")
    if given is None:
        inner = [getattr(model, "model", model) for model in models]
        own = [str(getattr(each, "name", type(each).__name__)) for each in inner]
        return [
            name if own.count(name) == 1 else f"{name} ({place})"
            for place, name in enumerate(own, start=1)
        ]
    if len(given) != len(models) or len(set(given)) != len(given):
        raise OptionError(
            "names do not fit the models",
            found=", ".join(given),
            needed=f"{len(models)} different names",
        )
    return list(given)


def _compared(
    models: Sequence[object], records: tuple[Record, ...], outputs: Sequence[str] | None
) -> tuple[str, ...]:
    """Outputs that all models have and all records hold."""
    shared = [
        name
        for name in output_names(models[0])
        if all(name in output_names(each) for each in models)
    ]
    if outputs is None and len(models) > 1:
        outputs = [name for name in shared if all(name in record for record in records)] or shared
    for model in models:
        held = outputs_held(model, records, outputs)
    return held


def _require_change(records: tuple[Record, ...], outputs: tuple[str, ...]) -> None:
    for record in records:
        for name in outputs:
            if np.ptp(record[name]) == 0.0:
                raise DataError(
                    f"output {name!r} of record {record.name!r} does not change",
                    action="choose another record, or leave the output out",
                )
