"""Parameters that each record has for itself: mass by manoeuvre, or a constant of an equation.

Inside a fit they are inputs that stand still: a record that holds a channel of that name gives the
value, and where none does a constant shift of that input is estimated in each record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flightid.conventions import Role
from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.fitted_record import FittedRecord
from flightid.models import StateSpaceModel
from flightid.models.parameters import Parameters
from flightid.record import Channel, Record
from flightid.units import require_match

STILL = 1e-9
"""Relative change of a channel below which it is one value."""


@dataclass(frozen=True)
class RecordParameters:
    """A model and records in which some parameters have become inputs.

    Attributes
    ----------
    asked : StateSpaceModel
        As the caller gave it.
    model : StateSpaceModel
        With the parameters as inputs.
    records : tuple of Record
        With their values as channels.
    names : tuple of str
    estimated : tuple of str
        Those that no record holds.
    """

    asked: StateSpaceModel
    model: StateSpaceModel
    records: tuple[Record, ...]
    names: tuple[str, ...]
    estimated: tuple[str, ...]

    @classmethod
    def of(
        cls, model: object, data: Record | Sequence[Record], names: Sequence[str]
    ) -> RecordParameters:
        """Make inputs of parameters.

        Raises
        ------
        OptionError
            A model without equations, or a linear one that would no longer hold the departures
            from a trim that a record declares.
        UnknownNameError
            The model has no such parameter.
        DataError
            Some records hold a value and others none, or a channel that does not stand still.
        ModelError
            A tie or a delay needs the parameter.
        """
        records = (data,) if isinstance(data, Record) else tuple(data)
        if not isinstance(model, StateSpaceModel):
            raise OptionError(
                "parameters by record need equations",
                found=type(model).__name__,
                needed="a StateSpaceModel",
            )
        for name in names:
            if name not in model.parameters:
                raise UnknownNameError(
                    "record_parameters names no parameter",
                    found=name,
                    needed=", ".join(model.parameters),
                )
        held = tuple(name for name in names if _held(name, records))
        estimated = tuple(name for name in names if name not in held)
        inner = _as_inputs(model, names)
        if model.is_linear and not inner.is_linear and any(record.trim for record in records):
            raise OptionError(
                "parameters by record make these equations nonlinear, which hold whole channels",
                found="records that declare a trim",
                needed="records of departures: subtract the trim, and declare none",
            )
        widened = tuple(_widened(record, model, names) for record in records)
        return cls(model, inner, widened, tuple(names), estimated)

    def restored(self, fit: Fit) -> Fit:
        """The fit of the asked model, with the records' own values beside it.

        Its record parameters have the mean over the records.
        """
        records = tuple(map(self._restored_record, fit.records))
        means = {
            name: float(np.mean([each.constants[name].value for each in records]))
            for name in self.names
        }
        free = {p.name: p.value for p in fit.model.parameters.free}
        model = self.asked.with_fixed(**means).with_values(free)
        still = tuple(f"input {name} does not change" for name in self.names)
        findings = tuple(f for f in fit.findings if not f.message.startswith(still))
        return replace(fit, model=model, records=records, findings=findings)

    def _restored_record(self, item: FittedRecord) -> FittedRecord:
        shifts = dict(item.reference_shift)
        constants = {}
        for name in self.names:
            found = shifts.pop(name)
            base = float(item.measured[name][0])
            unit = self.asked.parameters[name].unit
            constants[name] = replace(found, value=base + found.value, unit=unit)
        return replace(item, reference_shift=shifts, constants=constants)


def with_record_values(
    model: StateSpaceModel, record: Record, names: Sequence[str]
) -> StateSpaceModel:
    """The model with the values of its record parameters that a record holds.

    Raises
    ------
    DataError
        A channel that does not stand still.
    """
    known = {name: _value(name, record) for name in names if _held(name, (record,))}
    return model.with_fixed(**known) if known else model


def _held(name: str, records: Sequence[Record]) -> bool:
    holders = [name in record for record in records]
    if any(holders) and not all(holders):
        lacking = next(r.name for r, has in zip(records, holders, strict=True) if not has)
        raise DataError(
            f"some records hold {name} and others do not",
            found=f"none in {lacking!r}",
            needed="the channel in every record, or in none, where it is estimated",
        )
    return all(holders)


def _value(name: str, record: Record) -> float:
    samples = record[name]
    if np.ptp(samples) > STILL * np.max(np.abs(samples)):
        raise DataError(
            f"{name} of record {record.name!r} does not stand still",
            found=f"{samples.min():g} to {samples.max():g}",
            needed="one value",
            action="make it an input of the model",
        )
    return float(samples[0])


def _as_inputs(model: StateSpaceModel, names: Sequence[str]) -> StateSpaceModel:
    kept = [p for p in model.parameters.values() if p.name not in names]
    units = {name: model.parameters[name].unit for name in names}
    trim = {name: float(model.parameters[name].value or 0.0) for name in names}
    every = model.pairs == model._every_pair
    return replace(
        model,
        input_units={**model.input_units, **units},
        parameters=Parameters(kept),
        trim={**model.trim, **trim},
        pairs=() if every else model.pairs,
        blocks=(),
        bare=None,
    )


def _widened(record: Record, model: StateSpaceModel, names: Sequence[str]) -> Record:
    channels = [c for key, c in record.channels.items() if key not in names]
    samples = {}
    for name in names:
        unit = model.parameters[name].unit
        value = float(model.parameters[name].value or 0.0)
        if name in record:
            require_match(name, record.unit(name), unit)
            value = _value(name, record)
        samples[name] = np.full(record.n_samples, value)
        channels.append(Channel(name, unit, Role.INPUT, "record parameter"))
    return record.replace(samples, channels=channels)
