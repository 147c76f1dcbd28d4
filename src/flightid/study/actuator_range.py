"""Limits of an actuator where nobody told them: what the records' input went through."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flightid.control.tuning.controller_options import ControllerOptions
from flightid.conventions import Light, Role
from flightid.findings import Finding
from flightid.models import Model
from flightid.record import Record
from flightid.record.checks import CHECK, REMOVE_OUTLIERS
from flightid.record.history import NEW_BASES, Step, spread_channels
from flightid.record.interpolation import Interpolation
from flightid.record.unit_changes import unit_changes
from flightid.study.record_files import RecordFile, load_records
from flightid.units import DIMENSIONLESS

if TYPE_CHECKING:
    from flightid.study.identified import ModelResults

CODE = "limits-untold"
DIGITS = 4
LEAVE_INPUTS = frozenset(
    {"read_records", NEW_BASES[0], CHECK, REMOVE_OUTLIERS, "Record.declare", "Record.with_roles",
     "Record.to_units", "Record.select", "Record.segment"}
)  # fmt: skip
"""Steps of a history after which an input is what its file holds, in another unit at most."""


def input_ranges(
    identified: Iterable[ModelResults], files: Sequence[RecordFile] = ()
) -> dict[str, tuple[float, float]]:
    """Least and largest sample of every input in all records of its models, fitted or unseen.

    Where a record lies on another grid than its file, what a filter made between samples (it rings
    beside a step) went through no actuator: the file's own samples are taken.

    Parameters
    ----------
    identified : iterable of ModelResults
    files : sequence of RecordFile
        Of a study of records.

    Returns
    -------
    dict of str to tuple of float
        By input, in its own unit; none where a model keeps no records.
    """
    found: dict[str, tuple[float, float]] = {}
    for item in identified:
        for record in (*item.training, *item.unfitted):
            for name in record.inputs:
                samples = _measured(record, name, files)
                held = samples[np.isfinite(samples)]
                if held.size:
                    ends = (*found.get(name, ()), float(held.min()), float(held.max()))
                    found[name] = (_told(min(ends)), _told(max(ends)))
    return found


def _measured(record: Record, name: str, files: Sequence[RecordFile]) -> NDArray[np.float64]:
    """Samples of an input in the span of a record, as its file holds them where that is known."""
    own = str(record.name)
    file = next((f for f in files if own == f.name or own.startswith(f"{f.name}: ")), None)
    if (
        file is None
        or not spread_channels([record.history], [name])
        or any(_moves(step, name) for step in record.history)
    ):
        return record[name]
    held = replace(file, interpolation=str(Interpolation.PREVIOUS))
    for each in load_records(held, {name: Role.INPUT}):
        if each.name == record.name:
            return each.to_units(**unit_changes(each, {name: record.unit(name)}))[name]
    return record[name]


def _moves(step: Step, name: str) -> bool:
    """Whether a step makes of an input something else than what its file holds."""
    bridged = step.operation == REMOVE_OUTLIERS and name in step.options
    return bridged or step.operation not in LEAVE_INPUTS


def _told(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def untold_limits(
    asked: ControllerOptions,
    input: str,
    model: Model,
    ranges: Mapping[str, tuple[float, float]],
) -> tuple[Finding, ...]:
    """What the records propose as limits of a controller that was given none.

    Parameters
    ----------
    asked : ControllerOptions
    input : str
        What the controller moves.
    model : model
    ranges : mapping of str to tuple of float
        Of `input_ranges`.

    Example
    -------
    >>> import flightid as fid
    >>> model = fid.load_model("rate_first_order")
    >>> seen = {"tau_phi": (-1.0, 1.0)}
    >>> told = untold_limits(ControllerOptions(), "tau_phi", model, seen)
    >>> print(told[0].message)
    the controller's output has no limits; in the records tau_phi went from -1 to 1
    >>> untold_limits(ControllerOptions(output_low=-0.5), "tau_phi", model, seen)
    ()
    """
    if input not in ranges or not (asked.output_low is None and asked.output_high is None):
        return ()
    low, high = ranges[input]
    unit = getattr(model, "units", {}).get(input, DIMENSIONLESS)
    told = "" if unit == DIMENSIONLESS else f" {unit}"
    said = f"the controller's output has no limits; in the records {input} went from "
    return (
        Finding(
            CODE,
            Light.GREEN,
            f"{said}{low:g} to {high:g}{told}",
            f"tell those of the actuator, or take these as a proposal: output_low={low:g}, "
            f"output_high={high:g}; at them the integral is driven back",
        ),
    )
