"""Blocks that every report shows alike: results as tables with their lights, and provenance."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib.metadata import version

from flightid.evidence import Evidence
from flightid.report.content import Block, KeyValues, Lights, TableBlock
from flightid.result import Result
from flightid.table import Cell, Table
from flightid.version import VERSION

LIBRARIES = ("numpy", "scipy", "h5py")


def result_blocks(result: Result, *, title: str = "", folded: bool = False) -> tuple[Block, ...]:
    """Lights of a result, then its table; the lights are not repeated as notes of the table.

    Parameters
    ----------
    result : Result
        What a stage made.
    title : str
        Title of the table in place of its own.
    folded : bool
        Open the table on demand.

    Returns
    -------
    tuple of Block
    """
    table = result.summary()
    said = {str(finding) for finding in result.findings}
    # A fit's evidence has a block of its own.
    examined = getattr(result, "evidence", None)
    said |= set(examined.lines) if isinstance(examined, Evidence) else set()
    notes = tuple(note for note in table.notes if note not in said)
    shown = Table(title or table.title, table.columns, table.rows, notes)
    lights = (Lights(tuple(result.findings)),) if result.findings else ()
    return (*lights, TableBlock(shown, folded))


def provenance(files: Mapping[str, str], options: Mapping[str, Cell]) -> tuple[Block, ...]:
    """What the numbers were made from, and with.

    Parameters
    ----------
    files : mapping of str to str
        SHA-256 by file name.
    options : mapping of str to cell
        Options of the run by name.

    Returns
    -------
    tuple of Block
    """
    versions: list[tuple[str, Cell]] = [("flightid", VERSION)]
    versions += [(name, version(name)) for name in LIBRARIES]
    versions += [("Python", platform.python_version()), ("machine", platform.platform())]
    return (
        KeyValues(tuple(files.items()), "Files (SHA-256)"),
        KeyValues(tuple(options.items()), "Options"),
        KeyValues(tuple(versions), "Versions"),
    )
