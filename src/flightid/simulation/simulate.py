"""Simulation over a record (native side: `linear_simulation.rs`, `nonlinear_simulation.rs`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.conventions import Role
from flightid.errors import DataError, ModelError, OptionError, ShapeError
from flightid.models import LinearModel, LinearSystem, NarxModel, StateSpaceModel
from flightid.models.linear.hold_equivalent import Hold
from flightid.models.model import Model, linear_system, model_of
from flightid.models.sampled.recursion import run_recursion
from flightid.models.state_space.first_sample import measured_start
from flightid.models.state_space.measured_states import declared_start
from flightid.record import Channel, InputHold, Record, Step
from flightid.record.chosen_hold import chosen_hold
from flightid.simulation.noise import (
    NOISE_PARTS,
    Noise,
    between_samples,
    disturbed_equations,
    linear_disturbance,
)
from flightid.simulation.nonlinear import run_equations, start_of


def simulate(
    source: object,
    record: Record,
    *,
    hold: Hold | None = None,
    initial_state: str | ArrayLike | Mapping[str, float] | None = None,
    substeps: int | None = None,
    input_bias: Mapping[str, float] | None = None,
    output_bias: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
    noise: Noise | None = None,
) -> Record:
    """Drive a model with the inputs of a record.

    Linear models are discretised exactly for the chosen hold, fractional delays included; sampled
    models run as they are, from rest at the point they hold about. A nonlinear `StateSpaceModel`
    advances by Runge-Kutta steps of fourth order and takes its inputs and states whole, not as
    departures from a trim. Before the first sample each input is taken to have had the value of
    that sample.

    Assumes: what the inputs do between their samples. ``"first"`` (straight lines) has no phase
    lag and belongs to models whose delay includes the half sample of an autopilot's output hold,
    as every model fitted to a measured frequency response does; ``"zero"`` (steps) adds that half
    sample itself. Biased when the two are mixed up: by half a sample of delay.

    Parameters
    ----------
    source : Fit or model
        Of any kind; or anything with ``inputs``, ``outputs`` and ``state_space()`` returning A, B,
        C, D and the delay of each input in s.
    record : Record
        Holds the inputs by name, in the model's units.
    hold : {"first", "zero"}, optional
        What the inputs do between samples. Default: what the record knows, else "first"; the
        record that comes back knows what was used.
    initial_state : str, array_like, shape (n,), or mapping of str to float, optional
        State at the first sample. Left out: the initial values that a `StateSpaceModel` declares,
        else trim; a mapping by state changes some entries of that. ``"trim"``: zero, for a
        nonlinear model its trim. ``"measured"``: what the outputs of the record tell at its first
        sample.
    substeps : int, optional
        Runge-Kutta steps in a sample interval, for a nonlinear model. Left out: enough for the
        fastest eigenvalue at the trim (step times eigenvalue at most 0.25).
    input_bias : mapping of str to float, optional
        Constant added to an input, in its unit (a reference shift).
    output_bias : mapping of str to float, optional
        Constant added to an output, in its unit.
    units : mapping of str to str, optional
        Units of the outputs; taken from the record's channel of the same name when left out.
    noise : Noise, optional
        White noise and gusts on the way, exact at the samples for a linear model, and errors of the
        sensors.

    Returns
    -------
    Record
        The inputs as they were and the model's outputs, on the record's time base.

    Raises
    ------
    UnknownNameError
        The record lacks an input, or noise is asked for on what the model does not have.
    OptionError
        Another hold, a bias for a channel that the model does not have, or substeps for a model
        that is discretised exactly.
    ShapeError
        Matrices or the initial state do not fit.
    ModelError
        The model has no state space.
    DataError
        The run diverges to infinity.

    Reference
    ---------
    Franklin, Powell & Workman, Digital Control of Dynamic Systems, 3rd ed., sections 4.3.3 (delays)
    and 6.3 (first-order hold); Van Loan, IEEE Trans. Automatic Control 23 (1978), eq. 1.2.

    Example
    -------
    >>> import numpy as np
    >>> time_s = np.arange(5) * 0.1
    >>> record = Record.from_arrays(time_s, inputs={"u": np.ones(5)})
    >>> lag = LinearSystem([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> bool(np.allclose(simulate(lag, record)["y"], 1 - np.exp(-time_s)))
    True
    """
    initial_state = _start_in_words(source, record, initial_state)
    model = _runnable(source, noise, initial_state)
    between = chosen_hold(record, hold).hold
    names, outputs = tuple(model.inputs), tuple(model.outputs)
    point = getattr(model_of(source), "operating_point", {})
    driven = record.matrix(names) + _biases(input_bias, names) - _column(point, names)
    first = between == "first"
    if isinstance(model, NarxModel):
        computed = model.from_rest(driven, record.sample_time_s)
    elif isinstance(model, StateSpaceModel) and not model.is_linear:
        computed = _run_nonlinear(model, driven, record, first, initial_state, substeps, noise)
    else:
        if substeps is not None:
            raise OptionError(
                "a linear model has no substeps: its discretisation is exact", found=substeps
            )
        computed = _run_linear(model, driven, record.sample_time_s, initial_state, first)
        if noise is not None and noise.moves:
            computed = computed + linear_disturbance(
                model, noise, record.sample_time_s, record.n_samples
            )
    if noise is not None:
        computed = computed + noise.on_sensors(outputs, record.n_samples)
    computed = computed + _column(point, outputs) + _biases(output_bias, outputs)
    units = {**getattr(model, "units", {}), **(units or {})}
    made = dict(zip(outputs, computed, strict=True))
    made_record = _as_record(record, names, made, units, between, noise)
    if getattr(model, "sample_time_s", None) is not None:
        # A sampled model reads its inputs at their samples alone.
        return made_record.replace(input_shape=record.input_shape)
    return made_record


def _start_in_words(source: object, record: Record, given: Any) -> Any:  # noqa: ANN401
    """The initial state that a word stands for; anything else as it is."""
    if not isinstance(given, str):
        return given
    if given == "trim":
        inner = model_of(source)
        # Of a linear model the start is a departure from the trim.
        if not isinstance(inner, StateSpaceModel):
            return None
        trim = {} if inner.is_linear else inner.trim
        return {name: trim.get(name, 0.0) for name in inner.states}
    if given != "measured":
        raise OptionError(
            "unknown start of a simulation",
            found=repr(given),
            needed="'trim', 'measured', numbers, or numbers by state",
            action="use predict, which solves for a start" if given == "estimate" else "",
        )
    model = model_of(source)
    if not isinstance(model, StateSpaceModel):
        raise OptionError("states of this model have no names", found=type(model).__name__)
    return measured_start(model, record)


def _runnable(
    source: object, noise: Noise | None, initial_state: object
) -> LinearModel | NarxModel:
    """The model as it is run: sampled ones as recursions."""
    model = model_of(source)
    if isinstance(model, NarxModel):
        if initial_state is not None or (noise is not None and noise.moves):
            raise OptionError(
                "a NARX model has no states to start from or to disturb",
                found="initial_state or process noise",
                needed="neither: it starts from lags at the training mean",
            )
        return model
    if getattr(model, "sample_time_s", None) is not None or (
        isinstance(model, Model) and not isinstance(model, LinearModel)
    ):
        return linear_system(model)
    if not isinstance(model, LinearModel):
        raise ModelError(
            "the model cannot be simulated",
            found=type(model).__name__,
            needed="a fit or a model, or an object with inputs, outputs and state_space()",
        )
    return model


def _column(values: Mapping[str, float], names: tuple[str, ...]) -> NDArray[np.float64]:
    return np.array([[values.get(name, 0.0)] for name in names]).reshape(len(names), 1)


def _run_nonlinear(
    model: StateSpaceModel,
    driven: NDArray[np.float64],
    data: Record,
    first: bool,
    initial_state: ArrayLike | Mapping[str, float] | None,
    substeps: int | None,
    noise: Noise | None,
) -> NDArray[np.float64]:
    """Outputs of a nonlinear model, disturbed or not, shape (p, n_samples)."""
    step, parts = data.sample_time_s, 1
    if noise is not None and noise.moves:
        # Straight lines between values of white noise would take its high frequencies away: with
        # that hold the noise has several values in a sample.
        parts = NOISE_PARTS if first else 1
        driven, step = between_samples(driven, parts), step / parts
        model, added = disturbed_equations(model, noise, step, driven.shape[1])
        driven = np.vstack([driven, added])
    _, computed = run_equations(
        model, driven, step, first_order_hold=first, initial_state=initial_state,
        substeps=substeps,
    )  # fmt: skip
    return computed[:, ::parts]


def _run_linear(
    model: LinearModel,
    driven: NDArray[np.float64],
    sample_time_s: float,
    initial_state: ArrayLike | Mapping[str, float] | None,
    first: bool,
) -> NDArray[np.float64]:
    """Outputs of a linear model, continuous or sampled, shape (p, n_samples)."""
    if isinstance(model, LinearSystem) and model.sample_time_s is not None:
        return _run_sampled(model, driven, sample_time_s, initial_state)
    a, b, c, d, delays_s, driven = with_constants(model, driven)
    start = _linear_start(model, initial_state, a.shape[0])
    _, computed = _native.simulate_linear(a, b, c, d, delays_s, driven, start, sample_time_s, first)
    return computed


def with_constants(
    model: LinearModel, driven: NDArray[np.float64], kept: NDArray[np.float64] | float = 1.0
) -> tuple[NDArray[np.float64], ...]:
    """A, B, C, D, delays and inputs of a linear model, its constant terms as one more input.

    `kept` is one for outputs that hold their constant, shape (n_outputs,).
    """
    a, b, c, d, delays_s = (np.ascontiguousarray(m, dtype=np.float64) for m in model.state_space())
    if not isinstance(model, StateSpaceModel):
        return a, b, c, d, delays_s, driven
    rates, levels = model.constants()
    if not (np.any(rates) or np.any(levels)):
        return a, b, c, d, delays_s, driven
    b, d = np.column_stack([b, rates]), np.column_stack([d, levels * kept])
    return a, b, c, d, np.append(delays_s, 0.0), np.vstack([driven, np.ones(driven.shape[1])])


def _run_sampled(
    model: LinearSystem,
    driven: NDArray[np.float64],
    sample_time_s: float,
    initial_state: ArrayLike | Mapping[str, float] | None,
) -> NDArray[np.float64]:
    step = model.sample_time_s or 0.0
    if abs(step - sample_time_s) > 1e-9 * step:
        raise DataError(
            "the record has another sample time than the sampled system",
            found=f"{sample_time_s:g} s",
            needed=f"{step:g} s",
            action="resample the record, or give the continuous system",
        )
    whole = model.with_pade()
    a, b, c, d, _ = whole.state_space()
    start = np.zeros(whole.order)
    given = _linear_start(model, initial_state, model.order)
    if given.shape != (model.order,):
        raise ShapeError("the initial state does not fit", found=given.shape, needed=(model.order,))
    start[: model.order] = given
    with np.errstate(over="ignore", invalid="ignore"):
        outputs = c @ run_recursion(a, b @ driven, start) + d @ driven
    if not np.all(np.isfinite(outputs)):
        raise DataError(
            "the run diverges to infinity",
            found=f"poles up to {np.abs(model.poles()).max():.4g} in size",
            needed="a stable system, or a shorter record",
        )
    return np.asarray(outputs, dtype=np.float64)


def _linear_start(
    model: LinearModel, given: ArrayLike | Mapping[str, float] | None, n: int
) -> NDArray[np.float64]:
    """Departure from the trim at the first sample."""
    if given is not None and not isinstance(given, Mapping):
        return np.array(given, dtype=np.float64)
    if not isinstance(model, StateSpaceModel):
        if given:
            raise OptionError("states of this model have no names", found=", ".join(given))
        return np.zeros(n)
    begun = declared_start(model).items()
    departs = {name: value - model.trim.get(name, 0.0) for name, value in begun}
    return start_of(model, {**departs, **(given or {})})


def _biases(biases: Mapping[str, float] | None, names: tuple[str, ...]) -> NDArray[np.float64]:
    for name in biases or {}:
        if name not in names:
            raise OptionError("a bias has no channel", found=name, needed=f"one of {list(names)}")
    return _column(biases or {}, names)


def _as_record(
    data: Record,
    inputs: tuple[str, ...],
    computed: Mapping[str, NDArray[np.float64]],
    units: Mapping[str, str] | None,
    hold: InputHold,
    noise: Noise | None,
) -> Record:
    known = data.channels
    options = {"hold": hold} if noise is None else {"hold": hold, "noise": repr(noise)}
    channels = [known[name] for name in inputs]
    for name in computed:
        given = (units or {}).get(name) or (known[name].unit if name in known else "1")
        channels.append(Channel(name, given, Role.OUTPUT, "simulated"))
    return data.replace(
        computed,
        channels=channels,
        step=Step("simulate", options),
        input_shape=replace(data.input_shape, hold=hold),
    )
