"""The verb `verify`: drive a model with recorded inputs and compare, shifts aside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, overload

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ModelError, OptionError, UnitError, UnknownNameError
from flightid.models import StateSpaceModel
from flightid.models.linear.hold_equivalent import Hold
from flightid.models.linear.linear_system import LinearModel
from flightid.record import Channel, Record, Step
from flightid.responses import FrequencyResponse
from flightid.units import canonical
from flightid.validation.verification.comparison import Comparison, compared
from flightid.validation.verification.judgement import guide_weights, judge
from flightid.validation.verification.muad import mismatch
from flightid.validation.verification.nonlinear_run import predict_equations
from flightid.validation.verification.result import Prediction, Verification
from flightid.validation.verification.shifts import Freedom, Shifts, predict

Initial = Literal["trim", "estimate"]


@overload
def verify(  # type: ignore[overload-overlap]  # a list is an object too
    source: list[object] | tuple[object, ...],
    records: Record | Sequence[Record],
    *,
    names: Sequence[str] | None = ...,
    state_bias: bool = ...,
    output_bias: bool = ...,
    initial_state: Initial = ...,
    outputs: Sequence[str] | None = ...,
    hold: Hold = ...,
    response: FrequencyResponse | None = ...,
) -> Comparison: ...


@overload
def verify(
    source: object,
    records: Record | Sequence[Record],
    *,
    names: None = ...,
    state_bias: bool = ...,
    output_bias: bool = ...,
    initial_state: Initial = ...,
    outputs: Sequence[str] | None = ...,
    hold: Hold = ...,
    response: FrequencyResponse | None = ...,
) -> Verification: ...


def verify(
    source: object,
    records: Record | Sequence[Record],
    *,
    names: Sequence[str] | None = None,
    state_bias: bool = True,
    output_bias: bool = True,
    initial_state: Initial = "trim",
    outputs: Sequence[str] | None = None,
    hold: Hold = "first",
    response: FrequencyResponse | None = None,
) -> Verification | Comparison:
    """Drive a model, or several side by side, with records' inputs and compare the outputs.

    ``dx/dt = A x + B (u - u_ref) + b``, ``y = C x + D (u - u_ref) + y_ref``: a free run over the
    whole record. Nothing of the model changes; state biases b, output biases y_ref and, with
    ``initial_state="estimate"``, the initial state are solved for by weighted least squares in each
    record, since they belong to the record. u_ref is the record's declared trim, or zero. The
    equations of a nonlinear model are integrated instead, on the channels as they are; its state
    bias is a constant shift of each input.

    Assumes: records that were not used in the fit, and start in trim unless the initial state is
    fitted; a nonlinear model that does not explode within a record. Biased when the record is short
    against the slowest mode: a free initial state can then imitate a response. For an unstable
    model fit the initial state: growing modes are then run backward from the end of the record,
    which is exact for records of any length, and a finding says where that explains rather than
    predicts.

    Parameters
    ----------
    source : Fit or model, or list or tuple of them
        A fit, or anything with inputs, outputs and state_space(). Of several the first is on
        trial and the others are its rivals.
    records : Record or sequence of Record
        What to predict; they hold the models' inputs and outputs by name and unit.
    names : sequence of str, optional
        Names of several models; default: their own.
    state_bias, output_bias : bool
        Solve for state biases b and output biases y_ref.
    initial_state : {"trim", "estimate"}
        Start at rest, or from a state that is solved for.
    outputs : sequence of str, optional
        Outputs to compare; default: those of the models that every record holds.
    hold : {"first", "zero"}
        What inputs do between samples, as for `flightid.simulate`.
    response : FrequencyResponse, optional
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
        No record, or an option that is not known.
    UnknownNameError
        A record lacks an input, or none of the outputs.
    UnitError
        A unit of the model and one of a record differ.
    DataError
        The free run diverges, or an output does not change.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., chapter 14.

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
    flown = (records,) if isinstance(records, Record) else tuple(records)
    if not flown:
        raise OptionError("there is nothing to verify on", needed="one record or more")
    if initial_state not in ("trim", "estimate"):
        raise OptionError(
            "initial_state is not known", found=initial_state, needed="'trim' or 'estimate'"
        )
    if hold not in ("first", "zero"):
        raise OptionError("hold is not known", found=hold, needed="'first' or 'zero'")
    several = source if isinstance(source, list | tuple) else [source]
    models = [_linear_model(each) for each in several]
    chosen = _compared(models, flown, outputs)
    freedom = Freedom(state_bias, output_bias, initial_state == "estimate")
    results = []
    for each in models:
        for record in flown:
            _require_units(each, record, chosen)
        predictions = tuple(_predict(each, record, chosen, freedom, hold) for record in flown)
        seen = None if response is None else mismatch(each, response)
        results.append(judge(predictions, chosen, initial_state, freedom, hold, seen))
    if not isinstance(source, list | tuple):
        return results[0]
    return compared(dict(zip(_names(models, names), results, strict=True)))


def _names(models: Sequence[object], given: Sequence[str] | None) -> list[str]:
    if len(models) < 2:
        raise OptionError("there is nothing to compare", found=len(models), needed="two models")
    if given is None:
        own = [str(getattr(each, "name", type(each).__name__)) for each in models]
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


def _linear_model(model: object) -> LinearModel:
    """The model itself, or the one inside a fit."""
    inner = getattr(model, "model", model)
    if not isinstance(inner, LinearModel):
        raise ModelError(
            "the model cannot be simulated",
            found=type(model).__name__,
            needed="a fit, or an object with inputs, outputs and state_space()",
        )
    return inner


def _compared(
    models: Sequence[LinearModel], records: tuple[Record, ...], outputs: Sequence[str] | None
) -> tuple[str, ...]:
    shared = [name for name in models[0].outputs if all(name in each.outputs for each in models)]
    for name in outputs or ():
        if name not in shared:
            raise UnknownNameError(
                "the model has no such output", found=name, needed=", ".join(shared)
            )
    wanted = tuple(shared if outputs is None else outputs)
    held = tuple(name for name in wanted if all(name in record for record in records))
    if not held or (outputs is not None and held != wanted):
        raise UnknownNameError(
            "a record lacks what the model predicts",
            found=", ".join(records[0].channels),
            needed=", ".join(wanted) or "outputs that all models have",
        )
    return held


def _require_units(model: LinearModel, record: Record, chosen: tuple[str, ...]) -> None:
    units = getattr(model, "units", None) or {}
    for name in (*model.inputs, *chosen):
        expected = units.get(name)
        if expected is not None and canonical(expected) != record.unit(name):
            raise UnitError(
                f"channel {name!r} has another unit in the record than in the model",
                found=record.unit(name),
                needed=canonical(expected),
                action="convert the record with to_units",
            )


def _predict(
    model: LinearModel,
    record: Record,
    chosen: tuple[str, ...],
    freedom: Freedom,
    hold: Hold,
) -> Prediction:
    rows = [list(model.outputs).index(name) for name in chosen]
    if isinstance(model, StateSpaceModel) and not model.is_linear:
        predicted, shifts = predict_equations(
            model,
            record.matrix(model.inputs),
            record.matrix(chosen),
            record.sample_time_s,
            rows=rows,
            freedom=freedom,
            weights=guide_weights(record, chosen),
            hold=hold,
        )
        return _prediction(record, model, chosen, predicted, shifts, hold)
    a, b, c, d, delays_s = (np.ascontiguousarray(m, dtype=np.float64) for m in model.state_space())
    trim = record.trim
    measured = record.matrix(chosen)
    offset = np.array([[trim.get(name, 0.0)] for name in chosen])
    driven = record.matrix(model.inputs)
    driven = driven - np.array([[trim.get(name, 0.0)] for name in model.inputs])
    predicted, shifts = predict(
        (a, b, np.ascontiguousarray(c[rows]), np.ascontiguousarray(d[rows]), delays_s),
        driven,
        measured - offset,
        record.sample_time_s,
        freedom=freedom,
        weights=guide_weights(record, chosen),
        hold=hold,
    )
    total = replace(shifts, reference=shifts.reference + offset[:, 0])
    return _prediction(record, model, chosen, predicted + offset, total, hold)


def _prediction(
    record: Record,
    model: LinearModel,
    chosen: tuple[str, ...],
    predicted: NDArray[np.float64],
    shifts: Shifts,
    hold: Hold,
) -> Prediction:
    known = record.channels
    channels = [known[name] for name in model.inputs]
    channels += [Channel(name, known[name].unit, known[name].role, "predicted") for name in chosen]
    made = record.replace(
        dict(zip(chosen, predicted, strict=True)),
        channels=channels,
        step=Step("verify", {"hold": hold}),
    )
    return Prediction(record, made, shifts)
