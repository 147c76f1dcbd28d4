"""The log: what a file holds, in the autopilot's own names, read when asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path

from flightid.conventions import Role
from flightid.errors import OptionError
from flightid.logs.channels.channel_map import ChannelMap
from flightid.logs.contents import LogContents
from flightid.logs.dataflash.sid_runs import SidRun, locate
from flightid.logs.self_check import InjectionCheck, check_injection
from flightid.logs.to_record import make_record
from flightid.record import InputHold, InputShape, Record
from flightid.record.hold import Loop
from flightid.record.timebase import GapPolicy


class Log(LogContents):
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
            What inputs do between their samples in the log; a record on a coarser base holds them
            low-passed, band-limited. Default: what the map says, where the inputs are on their own
            stamps, else unknown.
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
            self._run(sid_run),
            sample_rate_hz,
            roles,
            gaps,
            max_gap_s,
            name,
            InputShape(hold, period_s, loop),
        )

    def _run(self, sid_run: SidRun | int | None) -> SidRun | None:
        if sid_run is None or isinstance(sid_run, SidRun):
            return sid_run
        runs = self.sid_runs
        if not 0 <= sid_run < len(runs):
            raise OptionError(
                "there is no such system-identification run",
                found=sid_run,
                needed=f"0 to {len(runs) - 1}" if runs else "a log with SIDS and SIDD",
            )
        return runs[sid_run]
