"""Records as a time-domain fit takes them: arrays by channel, and each record's own numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.multistart import require_free
from flightid.identification.records.declared_numbers import declared_numbers, with_declared
from flightid.identification.records.options import (
    RecordOptions,
    chosen,
    initial_values,
)
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.models.state_space.first_sample import first_outputs
from flightid.record import Record
from flightid.record.several import as_records
from flightid.record.workable import require_workable
from flightid.units import require_match

Array = NDArray[np.float64]
NativeRecord = tuple[Array, Array, float]
Limits = list[tuple[float, float]]
NativeOwn = tuple[Array, Array, Array, list[int], list[int], list[int], Limits]


@dataclass(frozen=True)
class OwnNumbers:
    """What belongs to one record: values, and the places that are free.

    Attributes
    ----------
    initial, shift, bias : ndarray
        Initial state, input shifts, output biases.
    free_initial, free_shift, free_bias : list of int
    limits : list of tuple of float
        Least and largest value of each free number, in that order; empty where none has bounds.
    start : tuple of ndarray, optional
        Where `initial` is no initial state but conditions at both ends: the state at the first
        sample, shape (n_states,), and its derivatives by the free parameters, initial numbers and
        shifts, shape (n_states, columns).
    held : tuple of int
        States that are held at their measurement, noise and all.
    """

    initial: Array
    shift: Array
    bias: Array
    free_initial: list[int]
    free_shift: list[int]
    free_bias: list[int]
    limits: Limits = field(default_factory=list)
    start: tuple[Array, Array] | None = None
    held: tuple[int, ...] = ()

    @property
    def native(self) -> NativeOwn:
        """As the native half takes it."""
        return (
            self.initial,
            self.shift,
            self.bias,
            self.free_initial,
            self.free_shift,
            self.free_bias,
            self.limits,
        )

    @property
    def n_free(self) -> int:
        """Numbers that are free."""
        return len(self.free_initial) + len(self.free_shift) + len(self.free_bias)

    def filled(self, values: Array) -> OwnNumbers:
        """Copy with these values of the free numbers, in the order initial, shift, bias."""
        parts = [self.initial.copy(), self.shift.copy(), self.bias.copy()]
        places = (self.free_initial, self.free_shift, self.free_bias)
        start = 0
        for part, where in zip(parts, places, strict=True):
            part[where] = values[start : start + len(where)]
            start += len(where)
        return OwnNumbers(parts[0], parts[1], parts[2], *places, self.limits, held=self.held)


@dataclass(frozen=True)
class RecordSet:
    """A model's records, ready for a fit.

    Attributes
    ----------
    model : TransferFunctionModel or StateSpaceModel
    records : tuple of Record
    arrays : list of tuple
        Inputs (n_inputs, n_samples), outputs (n_outputs, n_samples) and sample time of each, with
        declared trims taken out.
    offsets : list of ndarray
        What was taken out of the outputs of each record, shape (n_outputs, 1).
    own : list of OwnNumbers
        Start of each record's own numbers.
    states : tuple of str
    hold : {"first", "zero", "band_limited"}
    """

    model: GreyBoxModel
    records: tuple[Record, ...]
    arrays: list[NativeRecord]
    offsets: list[Array]
    own: list[OwnNumbers]
    states: tuple[str, ...]
    hold: str

    @property
    def n_samples(self) -> int:
        """Samples of all records together."""
        return sum(record.n_samples for record in self.records)


def state_names(model: GreyBoxModel) -> tuple[str, ...]:
    """Names of the states; those of a transfer function are its response's, numbered."""
    if isinstance(model, StateSpaceModel):
        return tuple(model.states)
    names = []
    for name, (_, _, below, _) in model.factored().items():
        order = len(np.trim_zeros(_product(below), "f")) - 1
        names += [f"{name} {k + 1}" for k in range(order)]
    return tuple(names)


def _product(factors: Sequence[Array]) -> Array:
    result: Array = np.ones(1)
    for factor in factors:
        result = np.asarray(np.polymul(result, factor), dtype=np.float64)
    return result


def prepare_records(
    model: GreyBoxModel, data: Record | Sequence[Record], options: RecordOptions
) -> RecordSet:
    """Check records against the model and bring them to arrays.

    A declared trim of a record is taken out of its channels and the model's own trim put in its
    place, so that deviations are fitted; without one the channels are fitted as they are.

    Raises
    ------
    FitError
        The model has no free parameter.
    DataError
        A record is too short, or its samples are too large or too small to be worked with.
    UnknownNameError
        A record lacks a channel of the model.
    UnitError
        Record and model disagree on a unit.
    """
    records = as_records(data)
    require_free(model)
    states = state_names(model)
    # A nonlinear model takes its channels whole: no point stands for another.
    whole = isinstance(model, StateSpaceModel) and not model.is_linear
    trim = dict(model.trim) if isinstance(model, StateSpaceModel) else {}
    points = ((model.inputs, trim), (model.outputs, {} if whole else _output_trim(model)))
    at_trim = np.array([float(trim.get(name, 0.0)) for name in states])
    arrays, offsets, own = [], [], []
    for record in records:
        for name in (*model.inputs, *model.outputs):
            require_match(name, record.unit(name), model.units[name], record=str(record.name))
        require_workable(record, (*model.inputs, *model.outputs))
        shift_in, shift_out = (
            np.array(
                [
                    [record.trim[n] - point.get(n, 0.0) if n in record.trim and not whole else 0.0]
                    for n in names
                ]
            )
            for names, point in points
        )
        inputs = np.ascontiguousarray(record.matrix(model.inputs) - shift_in)
        outputs = np.ascontiguousarray(record.matrix(model.outputs) - shift_out)
        arrays.append((inputs, outputs, record.sample_time_s))
        offsets.append(shift_out)
        values, free_states, held = initial_values(
            options.initial_state, states, at_trim, _measured(model, inputs, outputs, at_trim)
        )
        declared = declared_numbers(model, options, "initial", states)
        initial, shift, bias = (
            with_declared(start, free, names, numbers)
            for names, start, free, numbers in (
                (states, values, free_states, declared),
                (
                    model.inputs,
                    np.zeros(len(model.inputs)),
                    chosen(options.input_bias, model.inputs, "input_bias"),
                    declared_numbers(model, options, "reference", model.inputs),
                ),
                (
                    model.outputs,
                    np.zeros(len(model.outputs)),
                    chosen(options.output_bias, model.outputs, "output_bias"),
                    declared_numbers(model, options, "bias", model.outputs),
                ),
            )
        )
        kept = tuple(place for place in held if states[place] not in declared)
        limits = [*initial[2], *shift[2], *bias[2]]
        if not np.any(np.isfinite(limits)):
            limits = []
        own.append(
            OwnNumbers(
                initial[0], shift[0], bias[0], initial[1], shift[1], bias[1], limits, held=kept
            )
        )
    _require_length(model, records, own)
    return RecordSet(model, records, arrays, offsets, own, states, options.hold)


def _measured(model: GreyBoxModel, inputs: Array, outputs: Array, at_trim: Array) -> Array:
    """Where the search for a record's initial state begins, or where that state is held."""
    if not isinstance(model, StateSpaceModel):
        return at_trim
    seen = first_outputs(model, inputs, outputs)
    return seen.states(outputs[:, :1])[:, 0]


def _require_length(
    model: GreyBoxModel, records: Sequence[Record], own: Sequence[OwnNumbers]
) -> None:
    for record, numbers in zip(records, own, strict=True):
        if record.n_samples * len(model.outputs) <= 2 * numbers.n_free:
            raise DataError(
                f"record {record.name!r} is too short for its own numbers",
                found=f"{record.n_samples} samples, {numbers.n_free} free numbers",
                needed="more than two measured values for each",
                action="use a longer record, or hold the initial state and biases",
            )
    measured = sum(record.n_samples for record in records) * len(model.outputs)
    free = len(model.parameters.free) + sum(numbers.n_free for numbers in own)
    if measured < 3 * free:
        raise DataError(
            "the records are too short for the parameters",
            found=f"{measured} measured values for {free} free numbers",
            needed="three for each",
        )


def _output_trim(model: GreyBoxModel) -> dict[str, float]:
    """Outputs at the point about which the model is linear."""
    if not isinstance(model, StateSpaceModel) or not any(model.trim.values()):
        return {}
    names = [*(f"{name}'" for name in model.states), *model.states, *model.inputs]
    point = np.array([float(model.trim.get(name, 0.0)) for name in names])
    found, _ = model.native.linearise(model.parameters.independent_values(), point)
    start = len(model.states)
    outputs = map(float, found[start : start + len(model.outputs)])
    return dict(zip(model.outputs, outputs, strict=True))
