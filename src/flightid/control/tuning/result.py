"""The noun: gains of several axes, and what their loops stand together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from flightid.control.tuning.pid_design import PidDesign, write_steps
from flightid.conventions import Light
from flightid.errors import UnknownNameError
from flightid.findings import Finding
from flightid.result import Result
from flightid.table import Cell, Column, Table


@dataclass(frozen=True)
class Together:
    """Loops of coupled axes, all closed.

    Attributes
    ----------
    axes : tuple of str
    stable_plants, n_plants : int
        Of the fresh plants, how many are stable, by the poles of the whole.
    disk_margin, worst_disk_margin : float or None
        α of the least disk of simultaneous gains and phases at all outputs that is not stood, at
        the estimate and at the worst plant; None where that is unstable.
    gain_db, phase_deg : float or None
        What all outputs may gain or lose at once, at the worst plant.
    flown_disk_margin : float or None
        With the flown gains, at the estimate.
    coupling : float or None
        Largest closed-loop gain from one axis' rate set-point to another axis' rate.
    flown_stable_plants : int
        Of the same plants, how many the flown gains hold stable.

    Example
    -------
    >>> Together(("roll", "pitch"), 300, 300, 0.9, 0.8, 7.4, 43.6, 1.1, 0.2, 300).all_stable
    True
    """

    axes: tuple[str, ...]
    stable_plants: int
    n_plants: int
    disk_margin: float | None
    worst_disk_margin: float | None
    gain_db: float | None
    phase_deg: float | None
    flown_disk_margin: float | None
    coupling: float | None
    flown_stable_plants: int

    @property
    def all_stable(self) -> bool:
        """Whether every plant is stable."""
        return self.stable_plants == self.n_plants

    def findings(self) -> Iterator[Finding]:
        """Verdicts on the loops together."""
        names = " and ".join(self.axes)
        if not self.all_stable:
            bad = self.n_plants - self.stable_plants
            yield Finding(
                "together-unstable",
                Light.RED,
                f"{names} closed together: {bad} of {self.n_plants} plants are unstable",
                "do not fly these gains; identify the coupling better",
            )
        elif self.gain_db is not None and self.phase_deg is not None:
            yield Finding(
                "together",
                Light.GREEN,
                f"{names} closed together: all plants stable; every output may change at once by "
                f"±{self.gain_db:.1f} dB or ±{self.phase_deg:.0f}° at the worst plant",
            )

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {key: list(v) if isinstance(v, tuple) else v for key, v in vars(self).items()}


@dataclass(frozen=True, eq=False, repr=False)
class Tuning(Result, schema="flightid.tuning/1"):
    """Result of `flightid.tune`.

    Attributes
    ----------
    designs : tuple of PidDesign
        One for each axis.
    together : tuple of Together
        One for each set of axes that one model couples.

    Example
    -------
    >>> Tuning((), ())
    Tuning(no axis)
    """

    designs: tuple[PidDesign, ...]
    together: tuple[Together, ...]

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
        return all(design.exists for design in self.designs)

    @property
    def gains(self) -> dict[str, float]:
        """New gains of all axes by the autopilot's names."""
        return {name: value for design in self.designs for name, value in design.gains.items()}

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts on each axis and on what they do together."""
        single = [finding for design in self.designs for finding in design.findings]
        return (*single, *(finding for each in self.together for finding in each.findings()))

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
        columns = tables[0].columns if tables else (Column("parameter"),)
        return Table("Gains", columns, rows, (*notes, *together))

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

    @property
    def plain(self) -> bool:
        """Whether gains are there, of controllers of their own and of no autopilot."""
        return self.exists and all(design.plain is not None for design in self.designs)

    def write(
        self, path: str | Path, *, overwrite: bool = False, accept_red: bool = False
    ) -> tuple[Path, ...]:
        """Write all axes as the autopilot's parameter files, step by step; see `PidDesign.write`.

        Raises
        ------
        DataError
            An axis has no gains, or a finding is red.
        OptionError
            A file is already there.
        """
        return write_steps(
            self.designs, self.findings, path, overwrite=overwrite, accept_red=accept_red
        )

    def _computed(self) -> dict[str, object]:
        return {
            "exists": self.exists,
            "designs": {design.axis: design for design in self.designs},
            "findings": self.findings,
        }

    def _tables(self) -> tuple[Table, ...]:
        return tuple(table for design in self.designs for table in design._tables())


def _in_short(design: PidDesign) -> str:
    return repr(design).removeprefix("PidDesign(").removesuffix(")")
