"""The noun of the room: what to fly, how large, how long, and what it would show."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from flightid.control.autopilots.parameter_files import (
    GainChange,
    write_ardupilot_parameters,
    write_betaflight_settings,
    write_px4_parameters,
)
from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.excitation import Plan
from flightid.files import write_atomically
from flightid.findings import Finding, said_once, worst, worst_last
from flightid.frozen import dataclass
from flightid.inspection.verdict_lines import verdict_lines
from flightid.planning.axis_guess import AxisGuess
from flightid.planning.flight_time import FlightTime
from flightid.planning.flown_sweeps import FLOWN_ONCE
from flightid.planning.loop_check import begins_small
from flightid.planning.procedures import STOP, Procedure
from flightid.planning.settings import INTEGERS, betaflight_cli
from flightid.result import Result
from flightid.table import Cell, Column, Table

DEGREES = math.degrees(1.0)


TYPICAL = "a typical vehicle"
BY_AUTOPILOT = "the autopilot, which sizes it"


@dataclass(frozen=True, eq=False)
class AxisSweep:
    """The sweep of one axis.

    Attributes
    ----------
    axis : str
    guess : AxisGuess or None
        What the axis is expected to be; None where the autopilot sizes its sweep itself.
    plan : Plan or None
        The sweep with what it would show.
    changes : tuple of GainChange
        Settings that make the autopilot fly and log it.
    is_flown_again : bool
        Whether the log flew this sweep, and a model rests on it: nothing is expected, it was seen.
    """

    axis: str
    guess: AxisGuess | None
    plan: Plan | None
    changes: tuple[GainChange, ...]
    is_flown_again: bool = False

    @property
    def amplitude(self) -> float | None:
        """Peak of the sweep: share of full command, rad/s or rad."""
        return None if self.plan is None else float(self.plan.excitation.peak[0])

    @property
    def size(self) -> str:
        """The amplitude as a pilot or a parameter has it."""
        if self.plan is None or self.amplitude is None:
            return ""
        unit = self.plan.excitation.unit
        if unit == "1":
            return f"{self.amplitude:.3g} of full"
        return f"{DEGREES * self.amplitude:.2g} {unit.replace('rad', 'deg')}"

    @property
    def rests_on(self) -> str:
        """What sizes it: the autopilot, the sweep that it repeats, the flight, what is typical."""
        if self.is_flown_again:
            return "the sweep of this log, as it flew"
        if self.plan is None:
            return BY_AUTOPILOT
        return "this flight" if self.guess is not None and self.guess.measured else TYPICAL

    @property
    def coherence(self) -> float | None:
        """Predicted coherence of sweep and rate, its mean over the band."""
        if self.plan is None or self.is_flown_again:
            return None
        return float(self.plan.axes[0].coherence.mean())

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "axis": self.axis,
            "measured": self.guess is not None and self.guess.measured,
            "reason": "" if self.guess is None else self.guess.reason,
            "amplitude": self.amplitude,
            "coherence": self.coherence,
            "plan": None if self.plan is None else self.plan.to_dict(),
            "changes": {each.name: each.value for each in self.changes},
        }


@dataclass(frozen=True, eq=False, repr=False)
class SweepPlan(Result, schema="flightid.sweep_plan/1"):
    """What to fly next: sweeps of each axis, their settings with the way back, time and battery.

    Attributes
    ----------
    name : str
        Log, or kind of vehicle.
    firmware : str
        As logged; empty without a log.
    procedure : Procedure
        How this autopilot sweeps.
    sweeps : tuple of AxisSweep
    n_records : int
        Sweeps of each axis.
    flight_time : FlightTime
    logging : str
        What to set so that the log is fast enough.
    findings : tuple of Finding
        Go or no-go.
    carried : tuple of str
        Axes of which the log can carry a model already.

    Example
    -------
    >>> import flightid as fid
    >>> plan = fid.plan_flight(vehicle="quad")
    >>> plan
    SweepPlan('quad', ArduCopter, 3 axes, begin small)
    """

    name: str
    firmware: str
    procedure: Procedure
    sweeps: tuple[AxisSweep, ...]
    n_records: int
    flight_time: FlightTime
    logging: str
    findings: tuple[Finding, ...] = ()
    carried: tuple[str, ...] = ()

    @property
    def is_go(self) -> bool:
        """Whether nothing on the list is red."""
        return worst(self.findings) is not Light.RED

    @property
    def verdict(self) -> str:
        """``"no-go"``, ``"once more"``, ``"not needed"``, ``"begin small"`` or ``"go"``.

        Not needed: the log carries every axis; once more: one of them was flown a single time.
        Small: some finding says to begin with a third of the amplitude.
        """
        if not self.is_go:
            return "no-go"
        if not self.sweeps:
            return "once more" if any(f.code == FLOWN_ONCE for f in self.findings) else "not needed"
        return "begin small" if any(map(begins_small, self.findings)) else "go"

    def summary(self) -> Table:
        """A line for each axis: what to fly."""
        columns = (
            *(Column("axis"), Column("amplitude"), Column("from", "Hz", 2), Column("to", "Hz", 2)),
            *(Column("sweep", "s", 3), Column("runs"), Column("settings")),
        )
        rows: list[tuple[Cell, ...]] = []
        for each in self.sweeps:
            file = self.file_of(each) if self.is_go else "none: no-go"
            if each.plan is None:
                rows.append((each.axis, *[None] * 4, self.n_records, file))
                continue
            low, high = (edge / math.tau for edge in each.plan.band_rad_s)
            length_s = each.plan.excitation.duration_s
            rows.append((each.axis, each.size, low, high, length_s, self.n_records, file))
        notes = tuple(self._notes())
        return Table(self.title, columns, tuple(rows), notes).without_empty_columns()

    def expected(self) -> Table:
        """What the log will show where the plan holds; rows only for axes that flightid sizes."""
        columns = (
            *(
                Column("axis"),
                Column("command to", "± % of full", 2),
                Column("rate to", "± deg/s", 2),
            ),
            *(Column("attitude to", "± deg", 2), Column("coherence", digits=2), Column("rests on")),
        )
        rows: list[tuple[Cell, ...]] = []
        for each in self.sweeps:
            if each.plan is None or each.guess is None:
                continue
            told, size = each.plan.axes[0], 100.0 / each.guess.vehicle.full_command
            rows.append(
                (
                    *(each.axis, size * told.peak_control, DEGREES * told.peak_rate_rad_s),
                    *(DEGREES * told.peak_attitude_rad, each.coherence),
                    each.rests_on,
                )
            )
        notes = ("Peaks are of the sweep with the loops closed; coherence, of sweep and rate, is a "
                 "mean over the band.",)  # fmt: skip
        return Table("What the sweep will show", columns, tuple(rows), notes)

    def _tables(self) -> tuple[Table, ...]:
        expected = self.expected()
        return (self.summary(), expected) if expected.rows else (self.summary(),)

    def on_screen(self) -> str:
        """Tables for a terminal, then every finding, the worst last, and the verdict at the end."""
        told = replace(self.summary(), notes=tuple(self._flying()))
        tables = (str(table) for table in reversed((told, *self._tables()[1:])))
        judged = verdict_lines(worst_last(self.findings))
        return "\n\n".join(filter(None, (*tables, judged, f"Verdict: {self.verdict}.")))

    def file_of(self, axis: AxisSweep) -> str:
        """Name of the file that sets an axis up; empty where nothing is to be set."""
        if self.procedure.how == "chirp":
            return "chirp.txt"
        if not axis.changes:
            return ""
        stem = axis.axis if self.procedure.how == "mode" else "settings"
        return f"{stem}{self.procedure.suffix}"

    @property
    def title(self) -> str:
        """Whose plan."""
        return f"Flight plan of {self.name}, {self.procedure.title}"

    def _notes(self) -> Iterator[str]:
        yield from self._flying()
        yield from map(str, said_once(worst_last(self.findings)))

    def _flying(self) -> Iterator[str]:
        if self.sweeps:
            yield f"{self.flight_time.words[0].upper()}{self.flight_time.words[1:]}."
            yield f"Log: {self.logging.removeprefix('log ')}."

    def settings(self, axis: str) -> Table:
        """What the file of an axis sets, beside what flew.

        Raises
        ------
        KeyError
            The plan has no such axis.
        """
        found = {each.axis: each for each in self.sweeps}[axis]
        rows = tuple((c.name, c.value, c.old, c.reason) for c in found.changes)
        columns = (
            Column("parameter"),
            Column("set", digits=7),
            Column("flown", digits=7),
            Column("why"),
        )
        return Table(f"Settings for {axis}", columns, rows)

    def write(
        self, path: str | Path, *, overwrite: bool = False, write_no_go: bool = False
    ) -> tuple[Path, ...]:
        """Write the settings of each axis, each with the file that takes them back.

        Parameters
        ----------
        path : str or Path
            Folder; is made where it is not there.
        overwrite : bool
            Replace files that exist.
        write_no_go : bool
            Write in spite of a no-go.

        Raises
        ------
        OptionError
            The plan is no-go, or a file is there already: it may be the only record of what the
            vehicle flew.
        OSError
            The folder cannot be written.
        """
        if not self.is_go and not write_no_go:
            raise OptionError(
                "a no-go plan leaves no settings that a vehicle could load",
                found="; ".join(f.message for f in self.findings if f.light is Light.RED),
                needed="a go, or write_no_go",
            )
        place = Path(path)
        place.mkdir(parents=True, exist_ok=True)
        if self.procedure.how == "chirp":
            wanted = [change for each in self.sweeps for change in each.changes]
            return (write_atomically(place / "chirp.txt", betaflight_cli(wanted)),)
        by_file = {self.file_of(each): each for each in reversed(self.sweeps) if each.changes}
        written: list[Path] = []
        for name, each in reversed(by_file.items()):
            file = place / name
            notes = [f"flightid plan of {self.name}: {Path(name).stem}"]
            if self.procedure.suffix == ".params":
                made = write_px4_parameters(
                    each.changes, file, notes=notes, integers=INTEGERS, overwrite=overwrite
                )
            elif self.procedure.suffix == ".txt":
                made = write_betaflight_settings(
                    each.changes, file, notes=notes, overwrite=overwrite
                )
            else:
                made = write_ardupilot_parameters(
                    each.changes, file, notes=notes, overwrite=overwrite
                )
            written += [each for each in (made.rollback, made.path) if each is not None]
        return tuple(written)

    @property
    def stop_if(self) -> tuple[str, ...]:
        """When to leave the sweep at once."""
        return STOP

    def _computed(self) -> dict[str, object]:
        batteries = self.flight_time.batteries
        return {"go": self.is_go, "verdict": self.verdict, "batteries": batteries}

    def __repr__(self) -> str:
        """Whose plan, how many axes and the verdict on one line."""
        axes = f"{len(self.sweeps)} axes"
        return f"SweepPlan({self.name!r}, {self.procedure.title}, {axes}, {self.verdict})"
