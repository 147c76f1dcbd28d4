"""Where a record's stamps come from, and whether a unit that nobody gave is plausible."""

from __future__ import annotations

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record.record import Record
from flightid.record.stamps import SLOWEST_S, finer_unit
from flightid.record.time_columns import USUAL

READ = "read_records"
SLOW_S, LONG_S = 0.1, 600.0
"""Samples as far apart as this over so long a record are asked about too: 2 kHz in ms has 0.5."""


def time_column(record: Record) -> str:
    """The file's column of the time, where it is not the usual one; else empty."""
    read = next((step for step in record.history if step.operation == READ), None)
    column = USUAL if read is None else read.options.get("time") or USUAL
    return "" if column == USUAL else str(column)


def time_said(record: Record) -> str:
    """The same with its unit, in words, and whether it is plausible; empty where all is usual.

    Example
    -------
    >>> import numpy as np
    >>> time_said(Record.from_arrays(np.arange(9) * 0.1, outputs={"y": np.arange(9.0)}))
    ''
    """
    question = time_question(record)
    asked = f"{question.message} — {question.action}" if question else ""
    if asked or not (column := time_column(record)):
        return asked
    read = next(step for step in record.history if step.operation == READ)
    unit = read.options["time_unit"] or "s, as nothing says otherwise"
    return f"{read.options['file']}: time from column {column!r} ({unit})"


def time_question(record: Record) -> Finding | None:
    """A question where stamps without a declared unit are far apart: a second, or long and slow.

    Parameters
    ----------
    record : Record

    Returns
    -------
    Finding or None
        Amber; None where a unit was stated, or where seconds are plausible.

    Example
    -------
    >>> import numpy as np
    >>> time_question(Record.from_arrays(np.arange(9) * 100.0, outputs={"y": np.arange(9.0)}))
    """
    read = next((step for step in record.history if step.operation == READ), None)
    if read is None or read.options.get("time_unit", "stated") is not None:
        return None
    spacing_s = float(read.options["row_spacing_s"] or 0.0)
    length_s = float(record.time_s[-1] - record.time_s[0])
    return slow_stamps(str(read.options["file"]), str(read.options["time"]), spacing_s, length_s)


def slow_stamps(file: str, column: str, spacing_s: float, length_s: float) -> Finding | None:
    """The same question of stamps whose unit nobody stated, taken for seconds.

    Example
    -------
    >>> slow_stamps("rig.csv", "t", 0.01, 60.0)
    >>> print(slow_stamps("rig.csv", "t", 0.5, 650.0))  # doctest: +ELLIPSIS
    [amber] rows of rig.csv are 0.5 s apart (2 Hz), and nobody stated ... time_unit='ms', or 's' ...
    """
    if spacing_s < (SLOW_S if length_s >= LONG_S else SLOWEST_S):
        return None
    guess, _ = finer_unit(spacing_s)
    return Finding(
        "time-unit-not-stated",
        Light.AMBER,
        f"rows of {file} are {spacing_s:.6g} s apart ({1 / spacing_s:.3g} Hz), and "
        f"nobody stated the unit of column {column!r}: is it {guess}?",
        f"declare time_unit={guess!r}, or 's' if it is seconds",
    )
