"""The log: what a file holds, in the autopilot's own names, read when asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path

from flightid.conventions import Role
from flightid.errors import MissingColumnError
from flightid.findings import Finding
from flightid.logs.channels.channel_map import ChannelMap
from flightid.logs.dataflash.sid_runs import SidRun, locate
from flightid.logs.log_table import LogTable
from flightid.logs.self_check import InjectionCheck, check_injection
from flightid.logs.source import ByteRange, Event, Gap, LogSource, MessageInfo, ParameterChange
from flightid.logs.to_record import make_record
from flightid.record import InputHold, InputShape, Record
from flightid.record.hold import Loop
from flightid.record.timebase import GapPolicy
from flightid.result import Result
from flightid.table import Column, Table

SUGGESTIONS = 12
"""How many message names an error lists before it stops."""


class Log(Result, schema="flightid.log/1"):
    """A flight log: message tables with their own stamps, units, parameters, events and gaps.

    Opening reads the file once to index it; a column is extracted when it is asked for. Use
    `flightid.read_log` rather than this class.

    Parameters
    ----------
    path : path-like
        The file.
    source : LogSource
        The file, opened by the reader of its format.

    Example
    -------
    >>> import flightid as fid
    >>> log = fid.read_log("flight.bin")                             # doctest: +SKIP
    >>> log.table("RATE").unit("R")                                  # doctest: +SKIP
    'deg/s'
    """

    def __init__(self, path: str | Path, source: LogSource) -> None:
        self._path = Path(path)
        self._source = source

    @property
    def path(self) -> Path:
        """The file."""
        return self._path

    @property
    def kind(self) -> str:
        """``"ardupilot"`` or ``"px4"``."""
        return self._source.kind

    @property
    def vehicle(self) -> str | None:
        """``"copter"``, ``"plane"``, …; None where the log does not tell."""
        return self._source.vehicle

    @property
    def firmware(self) -> str:
        """Firmware and version as logged; empty where the log does not tell."""
        return self._source.firmware

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

        Returns
        -------
        LogTable

        Raises
        ------
        MissingColumnError
            The log holds no such message or instance.
        """
        if name not in self._source.messages:
            raise MissingColumnError(
                "the log holds no such message", found=name, needed=self._near(name)
            )
        return LogTable(self._source, name, instance)

    @cached_property
    def sid_runs(self) -> tuple[SidRun, ...]:
        """Runs of ArduPilot's system-identification mode, in order; empty in other logs."""
        return locate(self)

    def check_injection(self, run: SidRun) -> InjectionCheck:
        """Prove where, with what sign and how late the logged chirp of a run reached the mixer."""
        return check_injection(self, run)

    def record(
        self,
        channels: ChannelMap | str | Path | None = None,
        *,
        names: Iterable[str] | None = None,
        span_s: tuple[float, float] | None = None,
        sid_run: SidRun | int | None = None,
        sample_rate_hz: float | None = None,
        roles: Mapping[str, Role | str] | None = None,
        gaps: GapPolicy | str = GapPolicy.ERROR,
        max_gap_s: float | None = None,
        name: str | None = None,
        hold: InputHold | None = None,
        period_s: float | None = None,
        loop: Loop | None = None,
    ) -> Record:
        """Make a record: mapped channels in SI units on one uniform time base.

        Parameters
        ----------
        channels : ChannelMap, str or path, optional
            Channel map, a shipped one by name or a TOML file; default: by kind and vehicle.
        names : iterable of str, optional
            Channels wanted; each must be there. Default: all of the map that the log holds.
        span_s : (float, float), optional
            First and last instant on the autopilot's clock, s; default: all, or the chirp of
            `sid_run`.
        sid_run : SidRun or int, optional
            Run of `sid_runs`, or its number: adds the injected signal as the channel
            ``"excitation"``, shifted to when it acted where `check_injection` proves the delay.
        sample_rate_hz : float, optional
            Samples per second; default: the rate of the slowest channel that the map marks as
            deciding (commands and rates), so that no content is invented.
        roles : mapping of str to Role, optional
            Roles that differ from the map's.
        gaps, max_gap_s : GapPolicy and float, optional
            What to do where a channel has no samples for long; see `to_uniform`.
        name : str, optional
            Name of the record; default: the file's.
        hold : {"zero", "first", "band_limited"}, optional
            What inputs do between the samples of the record; default: what the map says, where the
            inputs are on their own stamps, else unknown.
        period_s : float, optional
            Time after which the inputs repeat, s.
        loop : {"open", "closed"}, optional
            Whether anything moved the inputs after what the outputs did; default: unknown.

        Returns
        -------
        Record
            Its history tells source and method of each channel and what was left out.

        Raises
        ------
        DataError
            No map fits, or a gap or disordered stamps in the span.
        MissingColumnError
            A named channel is not in the log.
        OptionError
            There is no such run.
        """
        return make_record(
            self,
            channels,
            names,
            span_s,
            sid_run,
            sample_rate_hz,
            roles,
            gaps,
            max_gap_s,
            name,
            InputShape(hold, period_s, loop),
        )

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
