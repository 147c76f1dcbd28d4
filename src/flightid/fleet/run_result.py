"""What one run of a fleet did, or had done when it was interrupted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from flightid.findings import Finding, counted
from flightid.fleet.reasons import RefusalReason
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Column, Table


@dataclass(frozen=True, repr=False)
class FleetRun(Result, schema="flightid.fleet_run/1"):
    """What one run of a fleet did.

    Attributes
    ----------
    catalogue : str
        Folder or address.
    found : int
        Logs at the places of the fleet file.
    kept : int
        Of these, in the catalogue before, or taken by another run at the same time.
    outcomes : mapping of str to int
        Those that were taken, by outcome.
    findings : tuple of Finding
    reasons : tuple of RefusalReason
        Why those that were taken and gave no model did not, the commonest first.
    copies : mapping of str to str
        Addresses whose bytes another log had that was taken, and its address: found is the sum of
        what was kept, all outcomes and these.
    memory_bytes : int or None
        Most that a process had which took a log, B; None where none was taken, or nobody knows.

    Example
    -------
    >>> FleetRun("catalogue", 3, 1, {"fitted": 2})
    FleetRun(3 logs, 1 kept, 2 fitted)
    """

    catalogue: str
    found: int
    kept: int
    outcomes: dict[str, int]
    findings: tuple[Finding, ...] = ()
    reasons: tuple[RefusalReason, ...] = ()
    copies: Mapping[str, str] = field(default_factory=dict)
    memory_bytes: int | None = None

    @property
    def lines(self) -> tuple[str, ...]:
        """What was found, and what became of it: numbers add up to those found.

        Example
        -------
        >>> FleetRun("catalogue", 3, 1, {"fitted": 2}).lines
        ('3 logs, 1 of them in the catalogue before', '2 fitted')
        >>> FleetRun("catalogue", 3, 3, {}).lines
        ('3 logs, all in the catalogue before: nothing new',)
        >>> FleetRun("catalogue", 1, 0, {"fitted": 1}, memory_bytes=312_000_000).lines[-1]
        'at most 312 MB a process'
        """
        is_new = self.kept < self.found or not self.found
        before = f"{self.kept} of them" if is_new else "all"
        nothing = "" if is_new else ": nothing new"
        copies = len(self.copies)
        return (
            f"{counted(self.found, 'log')}, {before} in the catalogue before{nothing}",
            *(f"{number} {outcome}" for outcome, number in sorted(self.outcomes.items())),
            *([f"{copies} with the bytes of another"] if copies else []),
            *([f"at most {self.memory_bytes / 1e6:.0f} MB a process"] if self.memory_bytes else []),
        )

    def summary(self) -> Table:
        """Table of the numbers."""
        rows: list[tuple[str, int]] = [("logs found", self.found), ("kept", self.kept)]
        rows += [(f"{name} logs", n) for name, n in sorted(self.outcomes.items())]
        rows += [("copies of these", len(self.copies))] if self.copies else []
        if self.memory_bytes is not None:
            rows.append(("most memory of a process [MB]", round(self.memory_bytes / 1e6)))
        columns = (Column("what"), Column("number"))
        return Table(f"Run of {self.catalogue}", columns, tuple(rows))

    def __repr__(self) -> str:
        """Numbers of logs on one line."""
        told = ", ".join(f"{n} {name}" for name, n in sorted(self.outcomes.items())) or "none taken"
        return f"FleetRun({self.found} logs, {self.kept} kept, {told})"


class FleetInterrupt(KeyboardInterrupt):
    """Ctrl-C in a run: what is in the catalogue, and how to go on.

    Parameters
    ----------
    done, found : int
        Logs that are in the catalogue, and all at the places of the fleet file.
    """

    def __init__(self, done: int, found: int) -> None:
        super().__init__(
            f"Interrupted: {done} of {counted(found, 'log')} in the catalogue; the same command "
            "takes the rest."
        )
