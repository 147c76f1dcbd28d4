"""What a file of records holds, column by column: for those who are to name channels."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.record.formats import ColumnTable, file_format
from flightid.record.tables import read_table
from flightid.record.time_columns import near_times, told_time, with_time
from flightid.record.time_question import slow_stamps
from flightid.table import Cell, Column, Table

NO_TIME = "--sample-time-s SECONDS"


def table_contents(path: str | Path) -> Table:
    r"""Columns of a file with unit, samples, rate, range, and the stamps of a bag's topics.

    Parameters
    ----------
    path : str or Path
        CSV, Parquet, MATLAB, netCDF, or a ROS bag.

    Raises
    ------
    FileFormatError
        The content is of no known format, damaged or too large.

    Example
    -------
    >>> import tempfile
    >>> from flightid.files import write_atomically
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = write_atomically(Path(folder) / "a.csv", "time,p [deg/s]\n0,1\n1,3\n")
    ...     table_contents(path).rows
    (('time', None, 2, None, 0.0, 1.0), ('p', 'deg/s', 2, None, 1.0, 3.0))
    """
    path = Path(path)
    kind = file_format(path)
    table = read_table(path, kind, ())
    rows = tuple(_row(table, name) for name in table.lengths)
    moving = tuple(row for row in rows if row[-2] is None or row[-2] != row[-1])
    notes = [table.advice] if table.advice else []
    notes += [f"{path.name} is no UTF-8: read as {table.encoding}."] if table.encoding else []
    notes += _time(table)
    if table.clock is not None:
        notes += dict.fromkeys(table.clock(name).said for name in table.lengths)
    notes += _by_name(table)
    if len(moving) < len(rows):
        notes.append(f"Not listed: {len(rows) - len(moving)} columns that never move.")
    timed = "" if not any(note.startswith("No time") for note in notes) else f" {NO_TIME}"
    named = "--inputs COLUMN --outputs COLUMN where their names do not tell them"
    notes.append(f"Next: flightid tune {path.name}{timed} (model, modes, PID), {named}")
    columns = (
        *(Column("column"), Column("unit"), Column("samples"), Column("rate", "Hz")),
        *(Column("least"), Column("most")),
    )
    return Table(f"{path.name}: {len(rows)} columns, {kind}", columns, moving, tuple(notes))


def _by_name(table: ColumnTable) -> list[str]:
    """Units that the ends of names tell, where the file states none."""
    told = {name: table.unit(name) for name in table.lengths if name not in table.units}
    said = ", ".join(f"{name} as {unit}" for name, unit in told.items() if unit is not None)
    return [f"Read from the headings: {said}; units that are declared go first."] if said else []


def _time(table: ColumnTable) -> list[str]:
    """Which column is the time, or why none is."""
    try:
        timed, name = with_time(table, None)
    except OptionError as error:
        return [str(error)]
    if table.clock is None and name not in table.lengths:
        near = near_times(table) or "no column is named as one"
        return [f"No time: {near}; say --time COLUMN or {NO_TIME}."]
    told = told_time(timed, name)
    said = [f"{table.path.name}: {told}."] if told else []
    question = _question(timed, name)
    return [*said, f"{question.message} — {question.action}."] if question else said


def _question(table: ColumnTable, name: str) -> Finding | None:
    """Whether stamps whose unit nobody stated are seconds; None of those that have one."""
    if name not in table.lengths or table.clock is not None or table.units.get(name):
        return None
    stamps = table.raw(name)
    steps = np.diff(stamps[np.isfinite(stamps)]) if stamps.dtype.kind in "fiu" else np.empty(0)
    steps = steps[steps > 0]
    if not steps.size:
        return None
    return slow_stamps(table.path.name, name, float(np.median(steps)), float(steps.sum()))


def _row(table: ColumnTable, name: str) -> tuple[Cell, ...]:
    values, rate_hz = table.raw(name), None
    if table.clock is not None:
        steps = np.diff(table.clock(name).time_s)
        rate_hz = 1.0 / float(np.median(steps)) if steps.size and np.median(steps) > 0 else None
    least = most = None
    if values.dtype.kind in "fiub":
        finite = values[np.isfinite(values)]
        least, most = (float(finite.min()), float(finite.max())) if finite.size else (None, None)
    return name, table.unit(name), table.lengths[name], rate_hz, least, most
