"""A log whose tables are held as columns: what the smaller formats have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import MissingColumnError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.logs.source import ByteRange, Event, Gap, MessageInfo, ParameterChange, board_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MessageRows:
    """Rows of a message by column.

    Attributes
    ----------
    units : mapping of str to str
        Unit by field; ``"1"`` where there is none.
    read : callable
        Numbers of a field, shape (n,).
    time_s : ndarray, shape (n,)
        Stamps, s.
    words : mapping of str to list of str
        Fields that hold text.
    instances : tuple of int
        Number of the only instance, where messages of the kind have one.
    """

    units: Mapping[str, str]
    read: Callable[[str], Array]
    time_s: Array
    words: Mapping[str, list[str]] = field(default_factory=dict)
    instances: tuple[int, ...] = ()

    def info(self, name: str) -> MessageInfo:
        """What a listing says of the rows."""
        return MessageInfo.of_stamps(
            name, self.time_s.size, self.instances, self.units, tuple(self.words), self.time_s
        )


@dataclass(frozen=True, eq=False)
class TableSource:
    """A log held as tables; implements `LogSource`.

    Attributes
    ----------
    kind, vehicle, firmware
        As in `LogSource`.
    tables : mapping of str to MessageRows
        Messages that have rows.
    parameters, parameter_changes, events, skipped, gaps, findings
        As in `LogSource`.
    """

    kind: str
    vehicle: str | None
    firmware: str
    tables: Mapping[str, MessageRows]
    parameters: Mapping[str, float] = field(default_factory=dict)
    parameter_changes: Sequence[ParameterChange] = ()
    events: Sequence[Event] = ()
    skipped: Sequence[ByteRange] = ()
    gaps: Sequence[Gap] = ()
    findings: Sequence[Finding] = ()

    @cached_property
    def board(self) -> str:
        """Unique number of the processor, of the texts that it sent."""
        return board_of(event.text for event in self.events if event.kind == "text")

    @cached_property
    def messages(self) -> Mapping[str, MessageInfo]:
        """Messages that have rows."""
        return {name: rows.info(name) for name, rows in self.tables.items()}

    def fields(self, message: str) -> tuple[Mapping[str, str], tuple[str, ...]]:
        """Unit by field name, and which fields hold text."""
        rows = self.tables[message]
        return rows.units, tuple(rows.words)

    # No format here has instances, of which the protocol asks.
    # ruff: noqa: ARG002
    def rows(self, message: str, instance: int | None) -> int:
        """Rows of a message."""
        return int(self.tables[message].time_s.size)

    def numbers(self, message: str, field: str, instance: int | None) -> Array:
        """Numbers of a field."""
        return self.tables[message].read(field)

    def columns(self, message: str, fields: Sequence[str], instance: int | None) -> list[Array]:
        """Numbers of several fields."""
        return [self.tables[message].read(name) for name in fields]

    def texts(self, message: str, field: str, instance: int | None) -> list[str]:
        """Texts of a field."""
        words = self.tables[message].words
        if field not in words:
            raise MissingColumnError(f"field {field} of {message} holds no text")
        return words[field]

    def time_s(self, message: str, instance: int | None) -> Array:
        """Stamps, s."""
        return self.tables[message].time_s
