"""Free runs of models without a noise model: linear ones and equations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from flightid.errors import OptionError, UnknownNameError
from flightid.identification.prediction.equations import predict_equations
from flightid.identification.prediction.free_run import growth
from flightid.identification.prediction.linear import Freedom, predict_linear
from flightid.identification.prediction.remembered import WORDS
from flightid.identification.prediction.request import FREE_RUN, LEAST_PER_STATE, Request
from flightid.identification.prediction.result import Prediction, Shifts
from flightid.identification.prediction.weights import guide_weights
from flightid.models import StateSpaceModel
from flightid.models.model import LinearModel
from flightid.models.state_space.first_sample import measured_start
from flightid.record import Channel, Record, Step
from flightid.simulation.simulate import with_constants

TOLD_BY = 3
"""A third of a record tells its start and biases, the whole is scored. Right models (noise 5 %, 20
and 60 s, in trim or off it) then stay green in 100 % of runs, with 3 % error in all modes too; a
spiral that grows with 0.1 1/s where the true one decays falls from a fit of 71 to 92 % to 76 to
-1052 %; from a tenth, right models start too poorly (80 % green)."""
TOLD_BY_ALL = 4.6
"""Growth, in e-folds over a record, from which its start is solved for over all of it: growth by a
hundred would lift what is left of the start's error above the motion."""


def predict_continuous(
    model: LinearModel, record: Record, outputs: tuple[str, ...], request: Request
) -> Prediction:
    """Predict one record; `flightid.predict` says how.

    Raises
    ------
    OptionError
        Steps ahead are asked of a model without a noise model, or a state that has no name.
    UnknownNameError
        The model has no such state.
    DataError
        The run grows beyond all numbers.
    """
    if request.horizon != FREE_RUN:
        raise OptionError(
            "this model has no noise model, so it predicts the same from any past",
            found=f"horizon={request.horizon!r}",
            needed="horizon='free_run'",
            action="identify an ARX … Box–Jenkins or innovations model to predict some steps ahead",
        )
    freedom = _freedom(model, record, request)
    freedom = replace(freedom, stretch=_stretch(model, record, request))
    if is_whole(model) and isinstance(model, StateSpaceModel):
        return _of_equations(model, record, outputs, request, freedom)
    return _of_matrices(model, record, outputs, request, freedom)


def is_whole(model: object) -> bool:
    """Whether a model takes its channels whole: nonlinear equations have no point to depart from.

    Example
    -------
    >>> is_whole(object())
    False
    """
    return isinstance(model, StateSpaceModel) and not model.is_linear


def _freedom(model: LinearModel, record: Record, request: Request) -> Freedom:
    start = request.initial_state
    estimated = is_whole(model) and start == "estimate"
    if isinstance(model, StateSpaceModel) and (estimated or start == "measured"):
        # A nonlinear search begins at the measurement.
        known = _measured(model, record, range(len(model.states)))
        return Freedom(request.state_bias, request.output_bias, estimated, known)
    if not isinstance(start, Mapping):
        solved = start in ("estimate", "measured")
        return Freedom(request.state_bias, request.output_bias, solved)
    names = _states(model)
    for name, value in start.items():
        if name not in names:
            raise UnknownNameError(
                "the model has no such state", found=name, needed=", ".join(names)
            )
        if isinstance(value, str) and value not in WORDS:
            raise OptionError(
                f"unknown start of state {name!r}",
                found=repr(value),
                needed="a number, " + ", ".join(map(repr, WORDS)),
            )
    free = tuple(names.index(name) for name, value in start.items() if value == "estimate")
    given = {
        names.index(name): float(value)
        for name, value in start.items()
        if not isinstance(value, str)
    }
    # What nothing says of whole channels is measured, and there their search begins.
    asked = ("measured", "estimate") if is_whole(model) else ("measured",)
    unsaid = [name for name in names if name not in start] if is_whole(model) else []
    wanted = [*unsaid, *(name for name, value in start.items() if value in asked)]
    if wanted and isinstance(model, StateSpaceModel):
        given |= _measured(model, record, [names.index(name) for name in wanted])
    return Freedom(request.state_bias, request.output_bias, free, given)


def _measured(model: StateSpaceModel, record: Record, places: Iterable[int]) -> dict[int, float]:
    start = measured_start(model, record)
    return {place: float(start[place]) for place in places}


def _states(model: LinearModel) -> list[str]:
    names = list(getattr(model, "states", ()))
    if not names:
        raise OptionError(
            "the states of this model have no names",
            found=type(model).__name__,
            needed="'trim', 'measured' or 'estimate'",
        )
    return names


def _stretch(model: LinearModel, record: Record, request: Request) -> int | None:
    """First samples that tell what is solved for; None where growing modes need the record.

    A third by default: the slow or growing mode of a wrong model, set by the whole record, explains
    it; set by the first third it has to predict the rest.
    """
    settle = request.settle_samples(record.n_samples, record.sample_time_s)
    if settle is not None:
        return settle or None
    if isinstance(model, StateSpaceModel):
        n_states = len(model.states)
    else:
        n_states = len(model.state_space()[0])
        if request.initial_state == "measured":
            return max(n_states, 1)
    if not is_whole(model) and growth(model.state_space()[0], record.duration_s) >= TOLD_BY_ALL:
        return None
    n_free = 2 * n_states + len(model.outputs)
    return min(max(record.n_samples // TOLD_BY, LEAST_PER_STATE * n_free), record.n_samples)


def _of_equations(
    model: StateSpaceModel,
    record: Record,
    outputs: tuple[str, ...],
    request: Request,
    freedom: Freedom,
) -> Prediction:
    predicted, shifts = predict_equations(
        model,
        record.matrix(model.inputs),
        record.matrix(outputs),
        record.sample_time_s,
        rows=[list(model.outputs).index(name) for name in outputs],
        freedom=freedom,
        weights=guide_weights(record, outputs),
        hold=request.hold,
    )
    return _prediction(record, model, outputs, predicted, shifts, request, freedom)


def _of_matrices(
    model: LinearModel,
    record: Record,
    outputs: tuple[str, ...],
    request: Request,
    freedom: Freedom,
) -> Prediction:
    rows = [list(model.outputs).index(name) for name in outputs]
    trim = record.trim
    offset = np.array([[trim.get(name, 0.0)] for name in outputs])
    driven = record.matrix(model.inputs)
    driven = driven - np.array([[trim.get(name, 0.0)] for name in model.inputs])
    # An output whose trim is declared holds its constant there.
    kept = np.array([name not in trim for name in model.outputs], dtype=np.float64)
    a, b, c, d, delays_s, driven = with_constants(model, driven, kept)
    predicted, shifts = predict_linear(
        (a, b, np.ascontiguousarray(c[rows]), np.ascontiguousarray(d[rows]), delays_s),
        driven,
        record.matrix(outputs) - offset,
        record.sample_time_s,
        freedom=freedom,
        weights=guide_weights(record, outputs),
        hold=request.hold,
    )
    total = replace(shifts, output_bias=shifts.output_bias + offset[:, 0])
    return _prediction(record, model, outputs, predicted + offset, total, request, freedom)


def _prediction(
    record: Record,
    model: LinearModel,
    outputs: tuple[str, ...],
    rows: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
    shifts: Shifts,
    request: Request,
    freedom: Freedom,
) -> Prediction:
    known = record.channels
    channels = [known[name] for name in model.inputs]
    channels += [Channel(name, known[name].unit, known[name].role, "predicted") for name in outputs]
    predicted = record.replace(
        dict(zip(outputs, rows, strict=True)),
        channels=channels,
        step=Step("predict", {"hold": request.hold}),
    )
    named = isinstance(model, StateSpaceModel)
    words = start_words(request, freedom.stretch or 0, record.sample_time_s, named=named)
    counted = request.settle_s is None and (named or request.initial_state != "measured")
    start = 0 if counted else freedom.stretch or 0
    return Prediction(record, predicted, outputs, request.horizon, words, start, shifts)


def start_words(request: Request, start: int, sample_time_s: float, *, named: bool) -> str:
    """Where a model without a noise model started; `named`: whether its states have names."""
    on = f"over the first {start * sample_time_s:.3g} s" if start else "over the whole record"
    if isinstance(request.initial_state, Mapping):
        solved = [name for name, value in request.initial_state.items() if value == "estimate"]
        if not solved:
            return "a given state"
        if len(solved) < len(request.initial_state):
            return f"a given state, of which {', '.join(solved)} solved for {on}"
        return f"an initial state solved for {on}"
    if request.initial_state == "measured" and named:
        return "the measured state"
    if request.initial_state in ("estimate", "measured"):
        return f"an initial state solved for {on}"
    return "rest at trim" if request.initial_state == "trim" else "rest"
