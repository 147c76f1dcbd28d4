"""PX4 ULog behind the `Log` noun (native half: `crates/logs/src/ulog/mod.rs`).

The format carries no units: stamps are microseconds, everything else is given as it was logged with
unit "1"; the channel maps know the units of the fields that they use.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.logs.log_cut import INSIDE, log_cut
from flightid.logs.source import ByteRange, Event, Gap, MessageInfo, ParameterChange
from flightid.logs.ulog.names import AIRFRAMES, ARMED, LEVELS, MODES, VEHICLE_TYPES, changes_of

STAMP = "timestamp"
MICROSECONDS = "µs"
CUT = f"{INSIDE} a record"
"""Reason of the native half (`framing.rs`) for the bytes after the last whole record."""
DEFAULT_KINDS = {1: "system", 2: "airframe"}


class UlogSource:
    """An opened ULog file.

    Parameters
    ----------
    path : path-like
        The file; it is mapped and walked through once, columns are made from them on demand.

    Raises
    ------
    LogFormatError
        The file is not a ULog, or needs abilities that this reader does not have.
    OSError
        The file cannot be read.
    """

    def __init__(self, path: str | Path) -> None:
        self._native = _native.open_ulog(str(path))

    @property
    def kind(self) -> str:
        """Always ``"px4"``."""
        return "px4"

    @cached_property
    def info(self) -> dict[str, int | float | str | bytes]:
        """Information entries of the header and data, the last of each name."""
        return dict(self._native.infos())

    @cached_property
    def multi_info(self) -> dict[str, list[list[int | float | str | bytes]]]:
        """Multiple-information entries: for each name a list of entries, each a list of parts."""
        entries: dict[str, list[list[int | float | str | bytes]]] = {}
        for continues, name, value in self._native.multi_infos():
            known = entries.setdefault(name, [])
            if continues and known:
                known[-1].append(value)
            else:
                known.append([value])
        return entries

    @cached_property
    def default_parameters(self) -> dict[str, dict[str, float]]:
        """Default values by whose they are (``"system"``, ``"airframe"``) and name."""
        found: dict[str, dict[str, float]] = {kind: {} for kind in DEFAULT_KINDS.values()}
        for bits, name, value in self._native.defaults():
            for bit, kind in DEFAULT_KINDS.items():
                if bits & bit and isinstance(value, int | float):
                    found[kind][name] = float(value)
        return found

    @cached_property
    def vehicle(self) -> str | None:
        """``"copter"``, ``"plane"``, ``"rover"``; None where the log does not tell."""
        if self._has("vehicle_status", "vehicle_type"):
            return VEHICLE_TYPES.get(int(self._last("vehicle_status", "vehicle_type")))
        if self._has("vehicle_status", "is_rotary_wing"):
            return "copter" if self._last("vehicle_status", "is_rotary_wing") else "plane"
        return AIRFRAMES.get(int(self.parameters.get("MAV_TYPE", -1)))

    @cached_property
    def firmware(self) -> str:
        """System name with release or commit."""
        name = str(self.info.get("sys_name", "")).rstrip("\0")
        release = self.info.get("ver_sw_release")
        if isinstance(release, int) and release > 0:
            numbers = ".".join(str(release >> shift & 0xFF) for shift in (24, 16, 8))
            return f"{name} v{numbers}".strip()
        return f"{name} {str(self.info.get('ver_sw', ''))[:8]}".strip()

    @cached_property
    def board(self) -> str:
        """Unique number of the processor, ``sys_uuid``."""
        return str(self.info.get("sys_uuid", "")).rstrip("\0")

    @cached_property
    def messages(self) -> Mapping[str, MessageInfo]:
        """Topics that have rows, in order of announcement."""
        rows: dict[str, dict[int, int]] = {}
        for name, instance, count in self._native.tables():
            if count:
                rows.setdefault(name, {})[instance] = count
        return {name: self._message(name, counts) for name, counts in rows.items()}

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Final value by parameter name."""
        final = _numbers(self._native.parameters())
        final.update(_numbers([(name, value) for _, name, value in self._native.changes()]))
        return final

    @cached_property
    def parameter_changes(self) -> list[ParameterChange]:
        """Parameters set while logging, in file order."""
        now = _numbers(self._native.parameters())
        changes = []
        for stamp_us, name, value in self._native.changes():
            if isinstance(value, int | float):
                old = now.get(name, float(value))
                changes.append(ParameterChange(stamp_us / 1e6, name, old, float(value)))
                now[name] = float(value)
        return changes

    @cached_property
    def events(self) -> list[Event]:
        """Text messages, modes and arming in order of time."""
        found = [
            Event(stamp_us / 1e6, "text", f"{LEVELS.get(level & 7, 'unknown')}: {text}")
            for stamp_us, level, _, text in self._native.lines()
        ]
        found += self._changes("vehicle_status", "nav_state", "mode", MODES)
        found += self._changes("vehicle_status", "arming_state", "arming", ARMED)
        return sorted(found, key=lambda event: event.time_s or 0.0)

    @cached_property
    def skipped(self) -> list[ByteRange]:
        """Every byte range that was not read."""
        return [ByteRange(*found) for found in self._native.skipped()]

    @cached_property
    def gaps(self) -> list[Gap]:
        """Spans in which the logger says that it lost samples."""
        return [
            Gap(stamp_us / 1e6, stamp_us / 1e6 + length_ms / 1e3, "the logger lost samples")
            for stamp_us, length_ms in self._native.dropouts()
        ]

    @cached_property
    def findings(self) -> list[Finding]:
        """Damage and dropouts."""
        found = []
        damaged = [part for part in self.skipped if part.reason != CUT]
        if len(damaged) < len(self.skipped):
            found.append(log_cut(CUT))
        if damaged:
            lost = sum(part.size for part in damaged)
            found.append(
                Finding(
                    "log-damaged",
                    Light.AMBER,
                    f"{lost} of {self._native.size()} bytes could not be read, in "
                    f"{counted(len(damaged), 'place')}; all records between them were kept",
                    "copy the log from the card again and compare",
                )
            )
        lost_s = [gap.duration_s for gap in self.gaps if gap.duration_s > 0]
        if lost_s:
            found.append(
                Finding(
                    "logger-dropouts",
                    Light.AMBER,
                    f"the logger lost samples {counted(len(lost_s), 'time')}, {sum(lost_s):.3g} s "
                    f"in all, the longest {max(lost_s):.3g} s",
                    "the card did not keep up with the log: use a faster card, or log fewer topics",
                )
            )
        return found

    def fields(self, message: str) -> tuple[Mapping[str, str], tuple[str, ...]]:
        """Unit by column name, and which columns hold text."""
        info = self.messages[message]
        return info.fields, info.text_fields

    def rows(self, message: str, instance: int | None) -> int:
        """Rows of a topic, or of one of its instances."""
        return sum(
            count
            for name, number, count in self._native.tables()
            if name == message and instance in (None, number)
        )

    def numbers(self, message: str, field: str, instance: int | None) -> NDArray[np.float64]:
        """Values as logged, shape (n_rows,)."""
        return self.columns(message, [field], instance)[0]

    def columns(
        self, message: str, fields: Sequence[str], instance: int | None
    ) -> list[NDArray[np.float64]]:
        """Values of several fields as logged."""
        return self._native.gather(message, instance, list(fields))

    def texts(self, message: str, field: str, instance: int | None) -> list[str]:
        """Character array as text, one a row, up to its first zero."""
        parts = [name for name, _ in self._native.columns(message) if _base(name) == field]
        codes = np.array(self._native.gather(message, instance, parts)).astype(np.int64) & 0xFF
        rows = codes.astype(np.uint8).T
        return [bytes(row).split(b"\0")[0].decode("utf-8", "replace") for row in rows]

    def time_s(self, message: str, instance: int | None) -> NDArray[np.float64]:
        """Stamps on the boot clock, s, shape (n_rows,), as logged."""
        return self.numbers(message, STAMP, instance) / 1e6

    def _message(self, name: str, counts: Mapping[int, int]) -> MessageInfo:
        columns = self._native.columns(name)
        fields = {
            column: MICROSECONDS
            if _base(column).startswith(STAMP) and "relative" not in column
            else "1"
            for column, _ in columns
        }
        texts = dict.fromkeys(
            _base(column) for column, kind in columns if kind == "char" and column.endswith("]")
        )
        fields.update(dict.fromkeys(texts, "1"))
        first = min(counts)
        stamps = self.time_s(name, first) if STAMP in fields else np.empty(0)
        if stamps.size > 1 and np.ptp(stamps) == 0:
            # Some topics are published without ever setting their stamp.
            stamps = np.empty(0)
        return MessageInfo.of_stamps(
            name, sum(counts.values()), tuple(sorted(counts)), fields, tuple(texts), stamps
        )

    def _has(self, message: str, field: str) -> bool:
        return message in self.messages and field in self.messages[message].fields

    def _last(self, message: str, field: str) -> float:
        return float(self.numbers(message, field, self.messages[message].instances[0])[-1])

    def _changes(
        self, message: str, field: str, kind: str, names: Mapping[int, str]
    ) -> list[Event]:
        if not self._has(message, field) or not self._has(message, STAMP):
            return []
        instance = self.messages[message].instances[0]
        values = self.numbers(message, field, instance).astype(np.int64)
        return changes_of(values, self.time_s(message, instance), field, kind, names)


def _base(column: str) -> str:
    """Column without the index of its last array."""
    return column[: column.rindex("[")] if column.endswith("]") else column


def _numbers(pairs: list[tuple[str, int | float | str | bytes]]) -> dict[str, float]:
    return {name: float(value) for name, value in pairs if isinstance(value, int | float)}
