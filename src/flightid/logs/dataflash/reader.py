"""ArduPilot DataFlash logs as a `LogSource` (native side: `crates/logs/src/dataflash/mod.rs`)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from itertools import repeat
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.conventions import Light
from flightid.errors import MissingColumnError
from flightid.findings import Finding, counted
from flightid.frozen import dataclass
from flightid.logs.dataflash.events import error_text, event_text, mode_text, vehicle_of
from flightid.logs.dataflash.field_units import (
    DEGREES_SINCE,
    UNDECLARED,
    UNITS,
    undeclared_units,
)
from flightid.logs.log_cut import INSIDE, log_cut
from flightid.logs.source import (
    ByteRange,
    Event,
    Gap,
    MessageInfo,
    ParameterChange,
    board_of,
    changes_among,
)
from flightid.units import DIMENSIONLESS

GAP_S = 0.2
"""Silence of all messages together that counts as a gap, s: even the slowest standard log bitmask
writes the inertial sensors at 25 Hz."""

_VERSION = re.compile(r"^(?P<name>[\w:+ -]*?(?:[Cc]opter|[Pp]lane|[Rr]over|Sub|Tracker|Blimp|Heli)"
                      r"[\w-]*) V(?P<age>\d+(\.\d+)?)")  # fmt: skip


class _Column(NamedTuple):
    label: str
    code: str
    unit: str
    multiplier: float
    width: int


@dataclass(frozen=True)
class _Layout:
    """A table of the file; most are never asked for, so what follows from it waits for that."""

    file: _native.DataflashFile
    table: int
    n_rows: int
    assumed: Callable[[], Mapping[str, str]]

    @cached_property
    def fields(self) -> list[_Column]:
        return [_Column(*field) for field in self.file.fields(self.table)]

    @cached_property
    def columns(self) -> dict[str, int]:
        """Place of each label, the first where one stands twice."""
        return {field.label: place for place, field in reversed(list(enumerate(self.fields)))}

    @cached_property
    def units(self) -> dict[str, str]:
        known = self.assumed()
        return {
            field.label: UNITS.get(field.unit, DIMENSIONLESS)
            if field.unit
            else known.get(field.label, DIMENSIONLESS)
            for field in self.fields
        }

    @cached_property
    def text_fields(self) -> tuple[str, ...]:
        return tuple(field.label for field in self.fields if field.width == 0)


class _Messages(Mapping[str, MessageInfo]):
    """Message infos by name, each made when it is asked for: describing reads every row."""

    def __init__(self, file: _native.DataflashFile, layouts: dict[str, _Layout]) -> None:
        self._file = file
        self._layouts = layouts
        self._made: dict[str, MessageInfo] = {}

    def __getitem__(self, name: str) -> MessageInfo:
        if name not in self._made:
            self._made[name] = self._describe(name, self._layouts[name])
        return self._made[name]

    def __contains__(self, name: object) -> bool:
        return name in self._layouts

    def __iter__(self) -> Iterator[str]:
        return iter(self._layouts)

    def __len__(self) -> int:
        return len(self._layouts)

    def _describe(self, name: str, layout: _Layout) -> MessageInfo:
        instances, stamps = self._file.describe(layout.table)
        first_s, last_s, step_s = stamps or (None, None, None)
        return MessageInfo(
            name,
            layout.n_rows,
            tuple(instances),
            layout.units,
            layout.text_fields,
            None if step_s is None else 1.0 / step_s,
            first_s,
            last_s,
        )


def open_dataflash(path: Path) -> DataflashSource:
    """Map and index a DataFlash log.

    Raises
    ------
    LogFormatError
        The file holds no DataFlash message.
    OSError
        The file cannot be read.
    """
    return DataflashSource(_native.open_dataflash(str(path)))


class DataflashSource:
    """A DataFlash log, indexed; implements `LogSource`.

    Parameters
    ----------
    file : _native.DataflashFile
        The indexed file.
    bad_lines : int
        Lines of a text log that are no message.
    """

    kind = "ardupilot"

    def __init__(self, file: _native.DataflashFile, bad_lines: int = 0) -> None:
        self._file = file
        self._bad_lines = bad_lines
        self._layouts: dict[str, _Layout] = {}
        self._renamed: list[str] = []
        self._rows: dict[tuple[str, int | None], int] = {}
        for index, (name, _, count) in enumerate(file.tables()):
            if count > 0:
                self._adopt(name, _Layout(file, index, count, partial(self._assumed, name)))
        self._messages = _Messages(file, self._layouts)

    def _assumed(self, name: str) -> Mapping[str, str]:
        """Units of a message in a log that declares none, by the firmware's age."""
        if "FMTU" in self._layouts or name not in UNDECLARED:
            return {}
        units = undeclared_units(name)
        if name != "RATE" or not self._holds_hundredths:
            return units
        return {label: "cdeg/s" if unit == "deg/s" else unit for label, unit in units.items()}

    @property
    def _holds_hundredths(self) -> bool:
        """Whether RATE is that of firmware before ArduCopter 3.4."""
        age = _VERSION.match(self.firmware)
        return age is not None and tuple(map(int, age["age"].split("."))) < DEGREES_SINCE

    def _adopt(self, name: str, layout: _Layout) -> None:
        """Take in a table of the file; a second layout under one name becomes ``NAME~2``."""
        label, copy = name, 1
        while label in self._layouts:
            copy += 1
            label = f"{name}~{copy}"
        if copy > 1:
            self._renamed.append(label)
        self._layouts[label] = layout

    @property
    def messages(self) -> Mapping[str, MessageInfo]:
        """Message types that have rows, in order of definition."""
        return self._messages

    def fields(self, message: str) -> tuple[Mapping[str, str], tuple[str, ...]]:
        """Unit by field name, and which fields hold text."""
        layout = self._layouts[message]
        return layout.units, layout.text_fields

    def rows(self, message: str, instance: int | None) -> int:
        """Rows of a message, or of one of its instances."""
        key = message, instance
        if key not in self._rows:  # of an instance they are counted one by one
            self._rows[key] = self._file.rows(self._layouts[message].table, instance)
        return self._rows[key]

    def places(self, message: str) -> NDArray[np.float64]:
        """Place of each row in the file, bytes."""
        return self._file.offsets(self._layouts[message].table)

    def numbers(self, message: str, field: str, instance: int | None) -> NDArray[np.float64]:
        """Scaled numbers; an int16[32] field has shape (n_rows, 32)."""
        return self.columns(message, [field], instance)[0]

    def columns(
        self, message: str, fields: Sequence[str], instance: int | None
    ) -> list[NDArray[np.float64]]:
        """Scaled numbers of several fields in one pass over the rows."""
        layout = self._layouts[message]
        places = [layout.columns[field] for field in fields]
        widths = [layout.fields[place].width for place in places]
        found = self._file.columns(layout.table, places, instance)
        return [
            values.reshape(-1, width) if width > 1 else values
            for values, width in zip(found, widths, strict=True)
        ]

    def texts(self, message: str, field: str, instance: int | None) -> list[str]:
        """Texts up to their first zero byte."""
        layout = self._layouts[message]
        return self._file.texts(layout.table, layout.columns[field], instance)

    def time_s(self, message: str, instance: int | None) -> NDArray[np.float64]:
        """Stamps on the autopilot's clock, s."""
        stamps = self._file.stamps(self._layouts[message].table, instance)
        if stamps is None:
            raise MissingColumnError(
                f"message {message} has no stamp", needed="a field TimeUS or TimeMS"
            )
        return stamps

    @cached_property
    def firmware(self) -> str:
        """First text message that names a vehicle and a version."""
        texts = self.texts("MSG", "Message", None) if self._has("MSG", "Message") else []
        return next((text for text in texts if _VERSION.match(text)), "")

    @cached_property
    def board(self) -> str:
        """Unique number of the processor, of the first text that ends in one."""
        return board_of(self.texts("MSG", "Message", None) if self._has("MSG", "Message") else ())

    @cached_property
    def vehicle(self) -> str | None:
        """Vehicle named by the firmware text."""
        return vehicle_of(self.firmware) if self.firmware else None

    def _parameter_rows(self) -> Iterator[tuple[float | None, str, float]]:
        if self._has("PARM", "Name", "Value"):
            names = self.texts("PARM", "Name", None)
            values = map(float, self.numbers("PARM", "Value", None))
            yield from zip(self._stamps_or_none("PARM"), names, values, strict=True)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Last value by parameter name."""
        return {name: value for _, name, value in self._parameter_rows()}

    @cached_property
    def parameter_changes(self) -> list[ParameterChange]:
        """Values that differ from the one logged before."""
        return changes_among(self._parameter_rows())

    @cached_property
    def events(self) -> list[Event]:
        """Modes, events, errors, arming and texts, in order of time."""
        found = [*self._modes(), *self._numbered(), *self._errors(), *self._texts()]
        return sorted(found, key=lambda event: -np.inf if event.time_s is None else event.time_s)

    def _modes(self) -> Iterator[Event]:
        field = "ModeNum" if self._has("MODE", "ModeNum") else "Mode"
        if not self._has("MODE", field) or field in self._messages["MODE"].text_fields:
            return
        reasons = self._integers("MODE", "Rsn") if self._has("MODE", "Rsn") else None
        for row, (time_s, number) in enumerate(self._stamped("MODE", field)):
            reason = None if reasons is None else reasons[row]
            yield Event(time_s, "mode", mode_text(self.vehicle, number, reason))

    def _numbered(self) -> Iterator[Event]:
        for time_s, number in self._stamped("EV", "Id"):
            kind = "arming" if number in (10, 11) else "event"
            yield Event(time_s, kind, event_text(number))

    def _errors(self) -> Iterator[Event]:
        if self._has("ERR", "Subsys", "ECode"):
            codes = self._integers("ERR", "ECode")
            for row, (time_s, subsystem) in enumerate(self._stamped("ERR", "Subsys")):
                yield Event(time_s, "error", error_text(subsystem, codes[row]))

    def _texts(self) -> Iterator[Event]:
        if self._has("MSG", "Message"):
            texts = self.texts("MSG", "Message", None)
            for time_s, text in zip(self._stamps_or_none("MSG"), texts, strict=True):
                yield Event(time_s, "text", text)

    @cached_property
    def skipped(self) -> tuple[ByteRange, ...]:
        """Byte ranges in no message."""
        return tuple(ByteRange(*item) for item in self._file.skipped())

    @cached_property
    def gaps(self) -> list[Gap]:
        """Spans above `GAP_S` in which no message of any kind is stamped."""
        silences = self._file.silences(GAP_S)
        return [Gap(start_s, stop_s, "no message of any kind") for start_s, stop_s in silences]

    @cached_property
    def findings(self) -> list[Finding]:
        """Bytes lost, messages dropped by the logger, units that are not known."""
        return [*self._loss(), *self._dropped(), *self._doubts()]

    def _loss(self) -> Iterator[Finding]:
        lost = [r for r in self.skipped if not r.reason.startswith(("filled with", INSIDE))]
        if self._bad_lines:
            yield Finding(
                "lines-skipped", Light.AMBER,
                f"{counted(self._bad_lines, 'line')} of the text log are no message of its own",
                "hand in the .bin file that it was made from, if it still exists",
            )  # fmt: skip
        if any(r.reason.startswith(INSIDE) for r in self.skipped):
            yield log_cut(f"{INSIDE} a message")
        if lost:
            size, places = sum(r.size for r in lost), counted(len(lost), "place")
            yield Finding(
                "bytes-skipped", Light.AMBER,
                f"{size} of {self._file.size()} bytes, in {places}, are no message",
                "copy the log from the vehicle again; look for gaps in the span you use",
            )  # fmt: skip

    def _dropped(self) -> Iterator[Finding]:
        if self._has("DSF", "Dp"):
            counts = self.numbers("DSF", "Dp", None)
            dropped = int(counts[-1] - counts[0])
            if dropped > 0:
                yield Finding(
                    "messages-dropped",
                    Light.AMBER,
                    f"the logger dropped {counted(dropped, 'message')} while it ran",
                    "log fewer messages (LOG_BITMASK) or use a faster card",
                )

    def _doubts(self) -> Iterator[Finding]:
        units = {field.unit for layout in self._layouts.values() for field in layout.fields}
        if unknown := units - set(UNITS):
            names = ", ".join(sorted(map(repr, unknown)))
            yield Finding(
                "unit-unknown",
                Light.AMBER,
                f"the log declares units that flightid does not know: {names}",
                "their fields are read as dimensionless",
            )
        if self._renamed:
            yield Finding(
                "layout-changed",
                Light.AMBER,
                f"messages change their layout inside the file: {', '.join(self._renamed)}",
                "this is probably two logs in one file; read them apart",
            )
        if "FMTU" not in self._messages:
            known = ", ".join(name for name in UNDECLARED if name in self._layouts)
            how = (
                "firmware of its age stores them"
                if _VERSION.match(self.firmware)
                else ("Copter 3.4 stored them, for no version of the firmware is told")
            )
            taken = f"; {known} are read as {how}" if known else ""
            if "RATE" in self._layouts and self._holds_hundredths:
                taken += ", RATE in hundredths of a deg/s and its commands to 4500"
            yield Finding(
                "no-units",
                Light.AMBER,
                "the log declares no units: its firmware is older than unit tables, or the part of "
                f"the log that holds them is missing{taken}",
                "name the units of other fields in a channel map of your own",
            )

    def _has(self, message: str, *fields: str) -> bool:
        info = self._messages.get(message)
        return info is not None and all(field in info.fields for field in fields)

    def _stamps_or_none(self, message: str) -> Iterable[float | None]:
        info = self._messages[message]
        if info.first_s is None:
            return repeat(None, info.count)
        return map(float, self.time_s(message, None))

    def _integers(self, message: str, field: str) -> list[int]:
        return [int(value) for value in self.numbers(message, field, None)]

    def _stamped(self, message: str, field: str) -> Iterator[tuple[float | None, int]]:
        if self._has(message, field):
            numbers = self._integers(message, field)
            yield from zip(self._stamps_or_none(message), numbers, strict=True)
