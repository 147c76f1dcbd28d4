"""The noun: gains of several axes, and what their loops stand together."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from flightid.control.tuning.gain_search_result import without_gains
from flightid.control.tuning.pid_design import PidDesign, require_gains, write_steps
from flightid.control.tuning.together import Together
from flightid.control.tuning.tuned_filters import TunedFilters
from flightid.conventions import Light
from flightid.errors import FlightidError, UnknownNameError
from flightid.findings import MOST_DIGITS, Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table


@dataclass(frozen=True)
class RefusedAxis:
    """An axis that its data do not allow to be tuned.

    Attributes
    ----------
    axis : str
    reason, action : str
        Why, and what to do about it.

    Example
    -------
    >>> print(RefusedAxis("pitch", "the fit is red", "sweep it again").finding.message)
    pitch is not tuned, and its gains stay as flown: the fit is red
    """

    axis: str
    reason: str
    action: str = ""

    @classmethod
    def by(cls, axis: str, error: FlightidError) -> RefusedAxis:
        """The axis that an error stops."""
        return cls(axis, error.reason, str(error.action or ""))

    @property
    def finding(self) -> Finding:
        """The verdict."""
        said = f"{self.axis} is not tuned, and its gains stay as flown: {self.reason}"
        return Finding("axis-refused", Light.RED, said, self.action)


@dataclass(frozen=True)
class UntouchedAxis:
    """An axis that nobody asked gains of: no failure, but whoever flies the others has to know.

    Attributes
    ----------
    axis : str
    reason : str

    Example
    -------
    >>> print(untouched_finding([UntouchedAxis(axis, "not swept") for axis in ("pitch", "yaw")]))
    [green] pitch, yaw: not swept, gains left as flown
    """

    axis: str
    reason: str


def untouched_finding(axes: Sequence[UntouchedAxis]) -> Finding:
    """One line of all of them, those with one reason together."""
    reasons: dict[str, list[str]] = {}
    for each in axes:
        reasons.setdefault(each.reason, []).append(each.axis)
    told = "; ".join(f"{', '.join(names)}: {why}" for why, names in reasons.items())
    return Finding("axis-untouched", Light.GREEN, f"{told}, gains left as flown")


@dataclass(frozen=True, eq=False)
class Tuning(Result, schema="flightid.tuning/1"):
    """Result of `flightid.tune`.

    Attributes
    ----------
    designs : tuple of PidDesign
        One for each axis.
    together : tuple of Together
        One for each set of axes that one model couples.
    refused : tuple of RefusedAxis
        Axes that were asked for and that their data do not allow; the others stand.
    filters : TunedFilters or None
        Filters that the gains were tuned with; None: those that flew, unasked.
    untouched : tuple of UntouchedAxis
        Axes of the autopilot that nobody asked for.

    Example
    -------
    >>> Tuning((), ())
    Tuning(no axis)
    """

    designs: tuple[PidDesign, ...]
    together: tuple[Together, ...]
    refused: tuple[RefusedAxis, ...] = ()
    filters: TunedFilters | None = None
    untouched: tuple[UntouchedAxis, ...] = ()

    def __getitem__(self, axis: str) -> PidDesign:
        """Design of an axis.

        Raises
        ------
        UnknownNameError
            The axis was not tuned.
        """
        for design in self.designs:
            if design.axis == axis:
                return design
        known = ", ".join(design.axis for design in self.designs)
        raise UnknownNameError("there is no such axis here", found=axis, needed=known)

    @property
    def exists(self) -> bool:
        """Whether every axis has gains."""
        return not self.refused and all(design.exists for design in self.designs)

    @property
    def gains(self) -> dict[str, float]:
        """New gains of all axes by the autopilot's names."""
        return {name: value for design in self.designs for name, value in design.gains.items()}

    @property
    def sound(self) -> tuple[PidDesign, ...]:
        """Axes whose gains may be written: found, without a red verdict, judged as they will fly.

        Axes that one model couples were judged with each other's new gains, so all of them are
        sound or none is; axes of models of their own stand alone.
        """
        return tuple(each for each in self.designs if each.axis not in self.left_out)

    @property
    def left_out(self) -> dict[str, str]:
        """Why the gains of an axis are not written, by axis."""
        reasons = {each.axis: each.reason for each in self.refused}
        reasons |= {each.axis: why for each in self.designs if (why := _unsound(each))}
        for each in self.together:
            reasons |= {axis.axis: axis.finding.message for axis in each.closed if not axis.is_kept}
            bad = [axis for axis in each.axes if axis in reasons]
            red = [finding.message for finding in each.findings() if finding.light is Light.RED]
            if bad or red:
                why = (
                    red[0] if red else f"one model couples it with {bad[0]}, which has none to fly"
                )
                reasons = dict.fromkeys(each.axes, why) | reasons
        lost = {} if self.filters is None else self.filters.unjudged(reasons)
        for axis, phase_deg in lost.items():
            why = f"the filters that it shares cost {axis} {phase_deg:.2g} deg, whose gains stay"
            reasons = {each.axis: why for each in self.designs} | reasons
        return reasons

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts on each axis and on what they do together."""
        single = [finding for design in self.designs for finding in design.findings]
        together = [finding for each in self.together for finding in each.findings()]
        filters = () if self.filters is None else self.filters.findings()
        refused = (each.finding for each in self.refused)
        return (*refused, *single, *together, *filters, *self._others)

    @property
    def _others(self) -> tuple[Finding, ...]:
        return (untouched_finding(self.untouched),) if self.untouched else ()

    def __repr__(self) -> str:
        """Axes with their worst phase margins on one line."""
        if not self.designs:
            return "Tuning(no axis)"
        return f"Tuning({'; '.join(map(_in_short, self.designs))})"

    def summary(self) -> Table:
        """Table of all gains, before and after."""
        tables = [design.gain_table() for design in self.designs]
        rows = tuple(row for table in tables for row in table.rows)
        notes = tuple(
            f"{design.axis}: {note}"
            for design, table in zip(self.designs, tables, strict=True)
            for note in table.notes
        )
        together = tuple(str(finding) for each in self.together for finding in each.findings())
        refused = tuple(str(each.finding) for each in self.refused)
        if self.filters is not None:
            together += tuple(map(str, self.filters.findings()))
        together += tuple(map(str, self._others))
        columns = tables[0].columns if tables else (Column("parameter"),)
        return Table("Gains", columns, rows, (*refused, *notes, *together))

    def together_table(self) -> Table:
        """What coupled axes stand together."""
        columns = (
            Column("axes"),
            Column("stable plants"),
            Column("disk margin", digits=3),
            Column("worst", digits=3),
            Column("all gains", "± dB", 3),
            Column("all phases", "± deg", 3),
            Column("stable as flown"),
            Column("flown disk margin", digits=3),
            Column("gain to the other axis", digits=2),
        )
        rows: tuple[tuple[Cell, ...], ...] = tuple(
            (
                " and ".join(each.axes),
                f"{each.stable_plants} of {each.n_plants}",
                *(each.disk_margin, each.worst_disk_margin, each.gain_db, each.phase_deg),
                f"{each.flown_stable_plants} of {each.n_plants}",
                *(each.flown_disk_margin, each.coupling),
            )
            for each in self.together
        )
        note = "Gains and phases that all outputs may gain or lose at once, each for itself."
        return Table("Coupled axes closed together", columns, rows, (note,))

    def closed_table(self) -> Table:
        """What axes that were designed alone promised, and what is left with all loops closed."""
        told = partial(Column, digits=MOST_DIGITS)
        columns = (
            *(Column("axis"), Column("loop"), Column("quantity"), Column("required")),
            *(told("designed alone"), told("all loops closed"), told("worst")),
            *(Column("unit"), Column("kept")),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                *(axis.axis, now.loop, now.name, now.required),
                now.shown(self[axis.axis].worst_case(now.loop, now.name).nominal),
                now.shown(now.nominal),
                now.shown_worst[0],
                *(now.unit, now.met if now.required else None),
            )
            for each in self.together
            for axis in each.closed
            for now in axis.worst_cases
        ]
        note = "Worst: of the fresh plants, with the new gains of all axes in their loops."
        return Table("Designed alone, closed together", columns, tuple(rows), (note,))

    @property
    def plain(self) -> bool:
        """Whether gains are there, of controllers of their own and of no autopilot."""
        made = [design for design in self.designs if design.exists]
        return bool(made) and all(design.plain is not None for design in made)

    def write(
        self, path: str | Path, *, overwrite: bool = False, accept_red: bool = False
    ) -> tuple[Path, ...]:
        """Write the sound axes as parameter files, step by step; see `PidDesign.write`.

        Every file names the axes that it leaves as they flew, and why. With `accept_red` every
        axis that has gains is written.

        Raises
        ------
        DataError
            No axis has gains without a red finding.
        OptionError
            A file is already there.
        """
        designs, left = self.writable(accept_red=accept_red)
        findings = self.findings if accept_red else ()
        return write_steps(
            designs, findings, path, left=left, overwrite=overwrite, accept_red=accept_red
        )

    def writable(
        self, *, accept_red: bool = False
    ) -> tuple[tuple[PidDesign, ...], tuple[str, ...]]:
        """Axes that a file may hold, and what it says of those that it leaves out.

        Raises
        ------
        DataError
            No axis has gains without a red finding.
        """
        designs = self.sound
        if accept_red:
            designs = tuple(each for each in self.designs if each.exists)
        if not designs:
            require_gains(self.designs, self.findings, accept_red=accept_red)
        kept = {each.axis for each in designs}
        left = tuple(
            f"{axis} is not in this file, its gains stay as flown: {why}"
            for axis, why in self.left_out.items()
            if axis not in kept
        )
        return designs, (*left, *(each.message for each in self._others))

    def _computed(self) -> dict[str, object]:
        return {
            "exists": self.exists,
            "designs": {design.axis: design for design in self.designs},
            "findings": self.findings,
        }

    def _tables(self) -> tuple[Table, ...]:
        filters = () if self.filters is None else (self.filters.table(),)
        return (*filters, *(table for design in self.designs for table in design._tables()))


def _unsound(design: PidDesign) -> str:
    """Why the gains of one axis alone are not to be flown; empty where they may."""
    if not design.exists:
        return without_gains(design.findings, design.binding).message
    red = [finding.message for finding in design.findings if finding.light is Light.RED]
    return red[0] if red else ""


def _in_short(design: PidDesign) -> str:
    return repr(design).removeprefix("PidDesign(").removesuffix(")")
