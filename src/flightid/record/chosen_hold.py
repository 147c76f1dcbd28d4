"""Which hold a verb uses: what it was told, else what its records know, else what is then said."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.record.history import is_of_log
from flightid.record.hold import BETWEEN, InputHold, InputShape, require_hold
from flightid.record.record import Record
from flightid.record.repeats import Staircase, found_staircase, is_switched
from flightid.record.several import as_records

DECLARED, RECORDED, FITTED = "declared", "record", "fit"
SEEN, ASSUMED = "samples", "assumed"


@dataclass(frozen=True)
class ChosenHold:
    """The hold that a verb uses, and on whose word.

    Attributes
    ----------
    hold : {"zero", "first", "band_limited"}
    source : {"declared", "record", "fit", "samples", "assumed"}
        "samples": inputs of two levels that nobody else speaks of, which are steps.
    findings : tuple of Finding
        What to know of it; empty where it was declared or the records know it.

    Example
    -------
    >>> ChosenHold("zero", "record").source
    'record'
    """

    hold: InputHold
    source: str
    findings: tuple[Finding, ...] = ()

    @property
    def in_time(self) -> Literal["zero", "first"]:
        """The hold of a run in time, which knows no other."""
        return "zero" if self.hold == "zero" else "first"

    def to_dict(self) -> dict[str, object]:
        """Plain values, for the provenance of a result."""
        return {"hold": self.hold, "hold_from": self.source}


def chosen_hold(
    records: Record | Sequence[Record],
    declared: str | None,
    *,
    known: tuple[InputHold, ...] = ("first", "zero"),
    assumed: InputHold = "first",
    inputs: Iterable[str] | None = None,
    fitted: InputHold | None = None,
) -> ChosenHold:
    """The hold for a verb on records.

    Parameters
    ----------
    records : Record or sequence of Record
    declared : str or None
        What the caller said; None takes what the records know.
    known : tuple of str
        Holds that the verb can compute with.
    assumed : str
        What it takes where nobody knows, or where it cannot compute with what the records know.
    inputs : iterable of str, optional
        The inputs in question; default: those of each record.
    fitted : str, optional
        What the model's fit was told, for records that do not know.

    Raises
    ------
    OptionError
        A declared hold that the verb does not know.
    DataError
        Two records with different holds and none declared.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1], inputs={"tau": [0.0, 0.3]}, hold="zero")
    >>> chosen_hold(record, None)
    ChosenHold(hold='zero', source='record', findings=())
    """
    listed = list(as_records(records))
    if declared is not None:
        return ChosenHold(require_hold(declared, known), DECLARED)
    found = hold_of_shapes([(each.name, each.input_shape) for each in listed], known, assumed)
    if found.source != ASSUMED or any(each.hold for each in listed):
        return found
    if fitted is not None:
        return ChosenHold(require_hold(fitted, known), FITTED)
    wanted = None if inputs is None else tuple(inputs)
    if "zero" in known and listed and all(is_seen_held(each, wanted) for each in listed):
        return ChosenHold("zero", SEEN, (_SWITCHED,))
    for record in listed:
        for name in record.inputs if wanted is None else wanted:
            stairs = found_staircase(record[name]) if name in record else None
            if stairs is not None:
                said = _stairs(record.name, name, stairs, assumed)
                return ChosenHold(assumed, ASSUMED, (said,))
    return found


def is_seen_held(record: Record, inputs: Iterable[str] | None = None) -> bool:
    """Whether every input that moves takes two levels alone, in a record that is none of a log.

    A log may show an output of the autopilot more seldom than its loop makes it.

    Example
    -------
    >>> record = Record.from_arrays(np.arange(40) / 10, inputs={"u": np.tile([0.0, 1.0], 20)})
    >>> is_seen_held(record)
    True
    """
    names = [name for name in (record.inputs if inputs is None else inputs) if name in record]
    moving = [record[name] for name in names if np.ptp(record[name]) > 0.0]
    return bool(moving) and not is_of_log([record.history]) and all(map(is_switched, moving))


def shape_of(record: Record) -> InputShape:
    """What a record knows of its inputs, held where nobody said and every one has two levels."""
    known = record.input_shape
    return replace(known, hold="zero") if known.hold is None and is_seen_held(record) else known


def hold_of_shapes(
    shapes: Sequence[tuple[str, InputShape]], known: tuple[InputHold, ...], assumed: InputHold
) -> ChosenHold:
    """The hold that shapes, each with the name of what has it, agree on; else what is assumed.

    Raises
    ------
    DataError
        Two of them differ.
    """
    holds: dict[InputHold, str] = {}
    for name, shape in shapes:
        if shape.hold is not None:
            holds.setdefault(shape.hold, name)
    if len(holds) > 1:
        raise DataError(
            "records hold their inputs differently between samples",
            found=" and ".join(f"{name!r} {BETWEEN[hold]}" for hold, name in holds.items()),
            needed="one hold in one fit",
            action="say hold=… for all of them, or fit them apart",
        )
    if not holds:
        return ChosenHold(assumed, ASSUMED, (_unknown(assumed),))
    hold = next(iter(holds))
    if hold not in known:
        return ChosenHold(assumed, ASSUMED, (_nearest(hold, assumed),))
    silent = [name for name, shape in shapes if shape.hold is None]
    said = () if not silent else (_others(silent[0], hold),)
    return ChosenHold(hold, RECORDED, said)


_SWITCHED = Finding(
    "hold-seen", Light.GREEN, "inputs taken as steps between samples: they take two levels alone"
)


def _unknown(assumed: InputHold) -> Finding:
    return Finding(
        "hold-unknown",
        Light.UNKNOWN,
        f"inputs taken as {BETWEEN[assumed]} between samples; the record does not say",
        "declare hold=…: a wrong one shifts delays by half a sample",
    )


def _stairs(record: str, name: str, stairs: Staircase, assumed: InputHold) -> Finding:
    return Finding(
        "hold-unknown",
        Light.AMBER,
        f"inputs taken as {BETWEEN[assumed]} between samples, yet {name} of {record!r} "
        f"{stairs}; the record does not say",
        "declare hold='zero' if the vehicle got these steps",
    )


def _nearest(hold: InputHold, assumed: InputHold) -> Finding:
    return Finding(
        "hold-nearest",
        Light.UNKNOWN,
        f"inputs are {BETWEEN[hold]} between samples; this method takes them as {BETWEEN[assumed]}",
        "sample faster than ten times the bandwidth, where both are the same",
    )


def _others(name: str, hold: InputHold) -> Finding:
    return Finding(
        "hold-unknown",
        Light.UNKNOWN,
        f"record {name!r} does not say how its inputs move between samples; taken as "
        f"{BETWEEN[hold]}, as the others do",
        "declare hold=… with the record",
    )
