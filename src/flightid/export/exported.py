"""What an export made: its files, and what to know of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table


@dataclass(frozen=True)
class ExportFiles(Result, schema="flightid.exported/1"):
    """Files written by `export`.

    Attributes
    ----------
    format : str
        ``"toml"``, ``"c"``, ``"fmu"``, …
    files : tuple of Path
        The first is the one asked for.
    facts : mapping of str to str
        What was written and how it is used, by keyword.
    findings : tuple of Finding
        What the format could not carry as it is.
    options : mapping of str to object
        Of the format, as they were used.

    Example
    -------
    >>> ExportFiles("c", (Path("roll.c"), Path("roll.h")), {"step": "0.0025 s"})
    ExportFiles(c: roll.c, roll.h)
    """

    format: str
    files: tuple[Path, ...]
    facts: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    options: Mapping[str, object] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Format and names of the files on one line, and the number of findings."""
        names = ", ".join(path.name for path in self.files)
        doubts = sum(finding.light is not Light.GREEN for finding in self.findings)
        return f"ExportFiles({self.format}: {names}{f', {doubts} findings' if doubts else ''})"

    def summary(self) -> Table:
        """Table of the files and facts, findings below."""
        rows: list[tuple[Cell, ...]] = [("file", str(path)) for path in self.files]
        rows += [(key, value) for key, value in self.facts.items()]
        notes = tuple(map(str, self.findings))
        return Table(
            f"Exported as {self.format}", (Column("what"), Column("value")), tuple(rows), notes
        )
