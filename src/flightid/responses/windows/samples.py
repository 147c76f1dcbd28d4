"""The channels of an estimate as plain arrays, after checking that the records agree."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass
from flightid.record import Record
from flightid.record.checks import CHECK, checked_history
from flightid.record.history import Step
from flightid.record.hold import SAME_SAMPLE_TIME
from flightid.record.several import as_records
from flightid.record.workable import require_workable
from flightid.units import clash


@dataclass(frozen=True)
class Samples:
    """Inputs, outputs and excitations of several records.

    Attributes
    ----------
    inputs, outputs, excitations : tuple of str
    units : dict of str to str
    sample_time_s : float
    records : tuple of ndarray, each shape (n_in + n_out + n_exc, n_samples)
        Rows in the order inputs, outputs, excitations; the mean of each row is removed.
    history : tuple of Step
        Of the first record.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    excitations: tuple[str, ...]
    units: dict[str, str]
    sample_time_s: float
    records: tuple[NDArray[np.float64], ...]
    history: tuple[Step, ...]

    @property
    def durations_s(self) -> tuple[float, ...]:
        """Length of each record, s."""
        return tuple(record.shape[1] * self.sample_time_s for record in self.records)

    def rows(self, kind: str) -> slice:
        """Rows of ``"inputs"``, ``"outputs"`` or ``"excitations"``."""
        n_in, n_out = len(self.inputs), len(self.outputs)
        return {
            "inputs": slice(0, n_in),
            "outputs": slice(n_in, n_in + n_out),
            "excitations": slice(n_in + n_out, None),
        }[kind]

    def part(self, kind: str) -> list[NDArray[np.float64]]:
        """The rows of one kind, of each record."""
        return [record[self.rows(kind)] for record in self.records]


def gather(
    records: Record | Iterable[Record],
    inputs: Iterable[str] | str | None,
    outputs: Iterable[str] | str | None,
    excitation: Iterable[str] | str | None,
    *,
    keep_mean: bool = False,
) -> Samples:
    """Take the channels out of the records.

    Raises
    ------
    DataError
        No record, no input or output, sample times that differ, or samples that are too large or
        too small to be worked with.
    UnitError
        A channel has different units in two records.
    UnknownNameError
        A record lacks a channel.
    """
    listed = list(as_records(records))
    if not listed:
        raise DataError("there is no record to estimate from", needed="at least one")
    names_in = _names(inputs, listed[0].inputs)
    names_out = _names(outputs, listed[0].outputs)
    names_exc = _names(excitation, ())
    for kind, names in (("input", names_in), ("output", names_out)):
        if not names:
            raise DataError(
                f"no {kind} channel",
                found=f"channels {', '.join(listed[0].channels)}",
                needed=f"a channel with the role {kind}, or names in {kind}s",
            )
    every = names_in + names_out + names_exc
    if len(set(names_in + names_out)) < len(names_in + names_out):
        raise OptionError("a channel is both input and output, or named twice", found=every)
    _require_agreement(listed, every)
    arrays = []
    for record in listed:
        require_workable(record, every)
        matrix = record.matrix(every)
        arrays.append(matrix if keep_mean else matrix - matrix.mean(axis=1, keepdims=True))
    return Samples(
        names_in,
        names_out,
        names_exc,
        {name: listed[0].unit(name) for name in every},
        listed[0].sample_time_s,
        tuple(arrays),
        _history(listed),
    )


def _history(records: Sequence[Record]) -> tuple[Step, ...]:
    """The first record's history, with what was found in the samples of all."""
    found = [step for record in records[1:] for step in checked_history(record)]
    return (*checked_history(records[0]), *(step for step in found if step.operation == CHECK))


def _names(given: Iterable[str] | str | None, default: Sequence[str]) -> tuple[str, ...]:
    if given is None:
        return tuple(default)
    return (given,) if isinstance(given, str) else tuple(given)


def _require_agreement(records: Sequence[Record], names: Iterable[str]) -> None:
    first = records[0]
    for record in records[1:]:
        if abs(record.sample_time_s / first.sample_time_s - 1.0) > SAME_SAMPLE_TIME:
            raise DataError(
                "records have different sample times",
                found=f"{first.sample_time_s:.6g} s and {record.sample_time_s:.6g} s",
                needed="one sample time",
                action="resample the records to one rate",
            )
        for name in names:
            if record.unit(name) != first.unit(name):
                raise clash(name, record.unit(name), first.unit(name), where="in another record")
