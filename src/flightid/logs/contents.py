"""What a log's file holds: tables, parameters, events and gaps, read when asked for."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

from flightid.errors import MissingColumnError
from flightid.findings import Finding
from flightid.logs.kept_arrays import KeptArrays
from flightid.logs.log_table import LogTable
from flightid.logs.source import ByteRange, Event, Gap, LogSource, MessageInfo, ParameterChange
from flightid.result import Result
from flightid.table import Column, Table

SUGGESTIONS = 12
"""How many message names an error lists before it stops."""


class LogContents(Result, schema="flightid.log/1"):
    """Message tables in the autopilot's own names; the half of a log that makes no records.

    Parameters
    ----------
    path : path-like
        The file.
    source : LogSource
        The file, opened by the reader of its format.
    """

    def __init__(self, path: str | Path, source: LogSource) -> None:
        self._path = Path(path)
        self._source = source
        self._kept = KeptArrays()

    @property
    def path(self) -> Path:
        """The file."""
        return self._path

    @property
    def kind(self) -> str:
        """By whom: ``"ardupilot"``, ``"px4"``, ``"betaflight"``, ``"inav"``, ``"mavlink"``."""
        return self._source.kind

    @property
    def vehicle(self) -> str | None:
        """``"copter"``, ``"plane"``, …; None where the log does not tell."""
        return self._source.vehicle

    @property
    def firmware(self) -> str:
        """Firmware and version as logged; empty where the log does not tell."""
        return self._source.firmware

    @property
    def board(self) -> str:
        """Unique number of the autopilot's processor; empty where the log does not tell."""
        return self._source.board

    @cached_property
    def messages(self) -> dict[str, MessageInfo]:
        """Message types that have rows, by name, in the order of the file's own tables."""
        return dict(self._source.messages)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Final value by parameter name, in the autopilot's units."""
        return dict(self._source.parameters)

    @cached_property
    def parameter_changes(self) -> list[ParameterChange]:
        """Parameters that changed while the log ran, in file order."""
        return list(self._source.parameter_changes)

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """Modes, errors, arming and text messages, in file order."""
        return tuple(self._source.events)

    @property
    def skipped(self) -> tuple[ByteRange, ...]:
        """Every byte range that was not read as a message, with the reason."""
        return tuple(self._source.skipped)

    @cached_property
    def gaps(self) -> tuple[Gap, ...]:
        """Spans without data in a log that goes on afterwards."""
        return tuple(self._source.gaps)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What the reader noticed about the file."""
        return tuple(self._source.findings)

    @cached_property
    def first_s(self) -> float | None:
        """Earliest stamp of any message, s; None in a log without stamps."""
        return min(
            (m.first_s for m in self.messages.values() if m.first_s is not None), default=None
        )

    @cached_property
    def last_s(self) -> float | None:
        """Latest stamp of any message, s; None in a log without stamps."""
        return max((m.last_s for m in self.messages.values() if m.last_s is not None), default=None)

    @property
    def duration_s(self) -> float:
        """Time from the earliest to the latest stamp, s; 0 in a log without stamps."""
        if self.first_s is None or self.last_s is None:
            return 0.0
        return self.last_s - self.first_s

    def __contains__(self, message: object) -> bool:
        """Tell whether the log holds rows of a message type."""
        return message in self._source.messages

    def table(self, name: str, instance: int | None = None) -> LogTable:
        """Rows of a message type by column.

        Parameters
        ----------
        name : str
            Message, for example ``"RATE"`` or ``"vehicle_attitude"``.
        instance : int, optional
            Instance (sensor number, PX4 multi-instance id); default: all rows in file order.

        Raises
        ------
        MissingColumnError
            The log holds no such message or instance.
        """
        if name not in self._source.messages:
            raise MissingColumnError(
                "the log holds no such message", found=name, needed=self._near(name)
            )
        return LogTable(self._source, name, instance, self._kept)

    def summary(self) -> Table:
        """Table of the message types with rows, instances, rate and span."""
        columns = (
            Column("message"),
            Column("rows"),
            Column("instances"),
            Column("rate", "Hz"),
            Column("first", "s", 6),
            Column("last", "s", 6),
        )
        rows = tuple(
            (m.name, m.count, len(m.instances) or None, m.rate_hz, m.first_s, m.last_s)
            for m in self.messages.values()
        )
        return Table(repr(self), columns, rows, tuple(str(finding) for finding in self.findings))

    def _computed(self) -> dict[str, object]:
        return {
            "path": str(self._path),
            "kind": self.kind,
            "vehicle": self.vehicle,
            "firmware": self.firmware,
            "messages": {
                m.name: {
                    "count": m.count,
                    "instances": list(m.instances),
                    "fields": dict(m.fields),
                    "rate_hz": m.rate_hz,
                    "first_s": m.first_s,
                    "last_s": m.last_s,
                }
                for m in self.messages.values()
            },
            "parameters": self.parameters,
            "events": [[e.time_s, e.kind, e.text] for e in self.events],
            "skipped": [[r.start, r.stop, r.reason] for r in self.skipped],
            "gaps": [[g.start_s, g.stop_s, g.reason] for g in self.gaps],
            "findings": [finding.to_dict() for finding in self.findings],
        }

    def __repr__(self) -> str:
        """Kind, firmware, size, duration and bytes lost on one line."""
        rows = sum(m.count for m in self.messages.values())
        lost = sum(r.size for r in self.skipped)
        return (
            f"Log({self._path.name!r}, {self.firmware or self.kind}, {rows} rows of "
            f"{len(self.messages)} messages, {self.duration_s:.4g} s, {lost} bytes skipped)"
        )

    def _near(self, name: str) -> str:
        """Names that exist: those that share the beginning first, then the others, shortened."""
        names = sorted(self.messages, key=lambda other: other[:2].lower() != name[:2].lower())
        more = len(names) - SUGGESTIONS
        return (
            "one of " + ", ".join(names[:SUGGESTIONS]) + (f" and {more} more" if more > 0 else "")
        )
