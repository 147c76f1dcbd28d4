"""Labels of records as JSON text: all that a table of numbers cannot say by itself."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Role
from flightid.errors import DataError, FileFormatError, FlightidError
from flightid.frozen import dataclass
from flightid.reading import parse_json
from flightid.record.channel import Channel
from flightid.record.display import plain_step
from flightid.record.history import Step
from flightid.record.hold import InputShape
from flightid.record.record import Record

SCHEMA = "flightid.records/1"
PLAIN_NAME = re.compile(r"^[A-Za-z]\w*$", re.ASCII)


@dataclass(frozen=True)
class RecordLabels:
    """Labels of one record.

    Attributes
    ----------
    name : str
        Name of the manoeuvre.
    n_samples : int
        Length, to tell a changed file.
    channels : tuple of Channel
        Names, units, roles and notes.
    variables : tuple of str
        Under which name each channel is stored.
    trim : mapping of str to float
        Trim values.
    history : tuple of Step
        What was done.
    input_shape : InputShape
        How the inputs move between samples, and whether they repeat.
    """

    name: str
    n_samples: int
    channels: tuple[Channel, ...]
    variables: tuple[str, ...]
    trim: Mapping[str, float]
    history: tuple[Step, ...]
    input_shape: InputShape

    def record(self, time_s: NDArray[np.float64], samples: Mapping[str, Any]) -> Record:
        """The record, from its stamps and its samples by variable."""
        pairs = list(zip(self.channels, self.variables, strict=True))
        groups: dict[Role, dict[str, Any]] = {role: {} for role in Role}
        for channel, variable in pairs:
            groups[channel.role][channel.name] = samples[variable]
        record = Record.from_arrays(
            time_s,
            inputs=groups[Role.INPUT],
            outputs=groups[Role.OUTPUT],
            excitations=groups[Role.EXCITATION],
            others=groups[Role.OTHER],
            units={channel.name: channel.unit for channel in self.channels},
            notes={channel.name: channel.note for channel in self.channels},
            trim=self.trim,
            name=self.name,
            history=self.history,
        )
        # Groups by role lose the order in which the channels stood.
        return record.replace(channels=self.channels, input_shape=self.input_shape)


def labels_of(record: Record, *, plain_names: bool) -> RecordLabels:
    """Labels of a record; with `plain_names` variables that a format cannot spell get a number."""
    channels = tuple(record.channels.values())
    names = [channel.name for channel in channels]
    variables = tuple(
        name if not plain_names or PLAIN_NAME.match(name) else f"_channel_{index}"
        for index, name in enumerate(names)
    )
    return RecordLabels(
        record.name, record.n_samples, channels, variables, record.trim, record.history,
        record.input_shape,
    )  # fmt: skip


def to_text(labels: Iterable[RecordLabels]) -> str:
    """JSON text of the labels of several records.

    Raises
    ------
    DataError
        An option in the history is no plain value.
    """
    content = {
        "schema": SCHEMA,
        "records": [
            {
                "name": item.name,
                "n_samples": item.n_samples,
                "channels": [
                    {
                        "name": channel.name,
                        "variable": variable,
                        "unit": channel.unit,
                        "role": str(channel.role),
                        "note": channel.note,
                    }
                    for channel, variable in zip(item.channels, item.variables, strict=True)
                ],
                "trim": dict(item.trim),
                "history": [plain_step(step) for step in item.history],
                "input_shape": item.input_shape.to_dict(),
            }
            for item in labels
        ],
    }
    return json.dumps(content, default=_plain)


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    raise DataError(
        "the history of a record holds a value that cannot be stored",
        found=f"{type(value).__name__} {value!r}"[:80],
        needed="text, numbers, truth values or None as options of a Step",
    )


def from_text(text: str, file_name: str) -> list[RecordLabels]:
    """Labels from their JSON text.

    Raises
    ------
    FileFormatError
        The text is no JSON, of another schema, or lacks a part.
    """
    try:
        content = parse_json(text, "the text of the labels", file_name)
        if content["schema"] != SCHEMA:
            raise FileFormatError(
                f"{file_name} was written with another schema",
                found=content["schema"],
                needed=SCHEMA,
                action="read it with the version of flightid that wrote it",
            )
        return [_record_labels(item) for item in content["records"]]
    except FlightidError:
        raise
    except (KeyError, TypeError, AttributeError, ValueError, OverflowError) as error:
        raise FileFormatError(
            f"the labels in {file_name} are damaged",
            found=f"{type(error).__name__}: {error}",
            action="write the file again",
        ) from error


def _record_labels(item: dict[str, Any]) -> RecordLabels:
    return RecordLabels(
        item["name"],
        int(item["n_samples"]),
        tuple(Channel(c["name"], c["unit"], Role(c["role"]), c["note"]) for c in item["channels"]),
        tuple(c["variable"] for c in item["channels"]),
        {key: float(value) for key, value in item["trim"].items()},
        tuple(
            Step(step["operation"], dict(step["options"]), step["version"])
            for step in item["history"]
        ),
        # Files of earlier versions do not say.
        InputShape(**item.get("input_shape", {})),
    )
