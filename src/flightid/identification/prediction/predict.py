"""The verb `predict`: any model driven by records' inputs, beside what was measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, overload

from flightid.errors import ModelError, OptionError, UnknownNameError
from flightid.identification.prediction.continuous import predict_continuous
from flightid.identification.prediction.narx import predict_narx
from flightid.identification.prediction.remembered import of_record, remembered, start_of_runs
from flightid.identification.prediction.request import FREE_RUN, Request
from flightid.identification.prediction.result import Prediction
from flightid.identification.prediction.sampled import predict_sampled
from flightid.identification.records.options import InitialState
from flightid.models import InnovationsModel, LinearSystem, NarxModel, PolynomialModel
from flightid.models.model import LinearModel, Model, model_of
from flightid.record import Record
from flightid.record.chosen_hold import chosen_hold
from flightid.record.hold import HOLDS, InputHold
from flightid.record.several import as_records
from flightid.units import canonical, clash, match

Predictor = Callable[[Any, Record, tuple[str, ...], Request], Prediction]
# Kind of model -> how it predicts; the first that fits. A new kind adds its line.
PREDICTORS: tuple[tuple[type[Any], Predictor], ...] = (
    (NarxModel, predict_narx),
    (PolynomialModel, predict_sampled),
    (InnovationsModel, predict_sampled),
    (LinearModel, predict_continuous),
)


@overload
def predict(
    source: object,
    records: Record,
    horizon: int | str = ...,
    *,
    outputs: str | Sequence[str] | None = ...,
    initial_state: InitialState | None = ...,
    settle_s: float | None = ...,
    state_bias: bool = ...,
    output_bias: bool = ...,
    hold: InputHold | None = ...,
) -> Prediction: ...


@overload
def predict(
    source: object,
    records: Sequence[Record],
    horizon: int | str = ...,
    *,
    outputs: str | Sequence[str] | None = ...,
    initial_state: InitialState | None = ...,
    settle_s: float | None = ...,
    state_bias: bool = ...,
    output_bias: bool = ...,
    hold: InputHold | None = ...,
) -> tuple[Prediction, ...]: ...


def predict(
    source: object,
    records: Record | Sequence[Record],
    horizon: int | str = FREE_RUN,
    *,
    outputs: str | Sequence[str] | None = None,
    initial_state: InitialState | None = None,
    settle_s: float | None = None,
    state_bias: bool = False,
    output_bias: bool = False,
    hold: InputHold | None = None,
) -> Prediction | tuple[Prediction, ...]:
    """Predict the outputs of records from their inputs, with any fit or model.

    Offsets and scaling come from the training records of the model, or from the trim that a record
    declares; never from the mean of the record that is predicted.

    Parameters
    ----------
    source : Fit or model
        Of any kind.
    records : Record or sequence of Record
        With the model's inputs and outputs, in its units.
    horizon : int or "free_run"
        Samples ahead, from the measured past, for models with a noise model and NARX; or the whole
        record from the inputs alone.
    outputs : str or sequence of str, optional
        Outputs to predict; default: those of the model that the record holds.
    initial_state : str or mapping, optional
        Where the run starts: ``"trim"``, ``"zero"`` (rest at the point the model holds about),
        ``"measured"`` (at the first sample; default of NARX, with its lags; states without a name
        are solved for on as few samples as there are), ``"estimate"`` (solved for), or by state a
        number or one of these words. Default: the word that a fit was told, else the initial values
        that the model declares (free ones solved for), else ``"estimate"``, whatever method fitted
        the model. What nothing measures begins as declared, else at trim; states of a linear model
        that a mapping leaves out are at trim.
    settle_s : float, optional
        First stretch, s, on which the start and the biases are solved for and which no score
        counts. Default: a tenth of the record for polynomial and innovations models; for those in
        continuous time the first third (the whole record where a mode grows a hundredfold, or where
        0 is given), and all of the record counts.
    state_bias, output_bias : bool
        Solve for a constant on each state derivative (of a nonlinear model: on each input), and on
        each output.
    hold : {"first", "zero", "band_limited"}, optional
        What the inputs of a model in continuous time do between samples; default: what each record
        knows, else "first".

    Returns
    -------
    Prediction, or tuple of Prediction for a sequence of records

    Raises
    ------
    ModelError
        The source cannot predict.
    OptionError
        An option that is unknown, or that this kind of model does not have.
    UnknownNameError
        A channel is missing.
    UnitError
        A channel in another unit.
    DataError
        Another sample time than a sampled model's, or a run that grows beyond all numbers.

    Assumes
    -------
    Records that took no part in the fit, whose first third tells the slowest mode's start.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., eqs. 3.20, 3.31 and 4.86; Billings, *Nonlinear System
    Identification*, Wiley 2013, section 5.5; biases: Tischler & Remple, *Aircraft and Rotorcraft
    System Identification*, 2nd ed., section 14.3.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])
    >>> u = np.random.default_rng(0).standard_normal(300)
    >>> record = fid.Record.from_arrays(np.arange(300) / 10, inputs={"u": u},
    ...                                 outputs={"y": np.zeros(300)})
    >>> record = record.replace({"y": truth.simulate(record)})
    >>> fid.predict(truth, record, settle_s=2.0)
    Prediction(free run from an initial state solved for over the first 2 s, 300 samples, fit y
    100.0 %)
    """
    model, way = predictor_of(source)
    asked = (outputs,) if isinstance(outputs, str) else outputs
    flown = as_records(records)
    if way is predict_continuous:
        initial_state = start_of_runs(source, initial_state)
    if not flown:
        raise OptionError("there is nothing to predict", needed="one record or more")
    chosen = outputs_held(model, flown, asked)
    for record in flown:
        require_units(model, record, chosen)
    made = tuple(
        way(
            of_record(source, model, record),
            record,
            chosen,
            Request(
                horizon,
                initial_state,
                settle_s,
                state_bias,
                output_bias,
                chosen_hold(record, hold, known=HOLDS, fitted=remembered(source).hold).hold,
            ),
        )
        for record in flown
    )  # fmt: skip
    return made[0] if isinstance(records, Record) else made


def predictor_of(source: object) -> tuple[Any, Predictor]:
    """The model of a source and how it predicts.

    Raises
    ------
    ModelError
        The source is no model and holds none.
    """
    model: Any = model_of(source)
    if isinstance(model, LinearSystem) and model.is_discrete:
        return _without_noise(model), predict_sampled
    for kind, way in PREDICTORS:
        if isinstance(model, kind):
            return model, way
    if isinstance(model, Model):
        # A kind without a line of its own is predicted by its linear system, or says why not.
        return predictor_of(model.linear_system())
    raise ModelError(
        "the model cannot be simulated",
        found=type(source).__name__,
        needed="a fit or a model, or an object with inputs, outputs and state_space()",
    )


def _without_noise(system: LinearSystem) -> InnovationsModel:
    """A sampled system as an innovations form without a noise model, its delays as states."""
    whole = system.with_pade()
    step_s = float(system.sample_time_s or 0.0)
    return InnovationsModel(
        system.inputs, system.outputs, step_s, *whole.state_space()[:4], units=system.units
    )


def output_names(model: object) -> tuple[str, ...]:
    """Outputs of a model of any kind."""
    inner: Any = model_of(model)
    several = getattr(inner, "outputs", None)
    return (inner.output,) if several is None else tuple(several)


def outputs_held(
    model: object, records: tuple[Record, ...], outputs: Sequence[str] | None
) -> tuple[str, ...]:
    """Outputs of a model that all records hold, or those asked for.

    Raises
    ------
    UnknownNameError
        The model or a record lacks one.
    """
    known = output_names(model)
    for name in outputs or ():
        if name not in known:
            raise UnknownNameError(
                "the model has no such output", found=name, needed=", ".join(known)
            )
    wanted = known if outputs is None else tuple(outputs)
    held = tuple(name for name in wanted if all(name in record for record in records))
    if not held or (outputs is not None and held != wanted):
        raise UnknownNameError(
            "a record lacks what the model predicts",
            found=", ".join(records[0].channels),
            needed=", ".join(wanted) or "outputs that all models have",
        )
    return held


def require_units(model: object, record: Record, outputs: tuple[str, ...]) -> None:
    """Refuse a record whose channels have other units than the model's.

    Raises
    ------
    UnitError
        A unit of the model and one of the record differ.
    """
    units = getattr(model, "units", None) or {}
    for name in (*getattr(model, "inputs", ()), *outputs):
        expected = units.get(name)
        if expected is not None and not match(record.unit(name), expected):
            raise clash(
                name,
                record.unit(name),
                canonical(expected),
                where="in the record than in the model",
            )
