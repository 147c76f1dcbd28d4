"""Where a record's stamps come from, and whether a unit that nobody gave is plausible."""

from __future__ import annotations

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record.record import Record
from flightid.record.time_columns import USUAL

READ = "read_records"
SLOWEST_S = 1.0
"""Samples further apart are rare in dynamics, and usual in files whose time is in ms."""
SLOW_S, LONG_S = 0.1, 600.0
"""Samples as far apart as this over so long a record are asked about too: 2 kHz in ms has 0.5."""
IN_MS_S = 1000.0
"""Whole numbers further apart than this look like microseconds rather than milliseconds."""


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
    asked = f"{question.message}; {question.action}" if question else ""
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
    spacing = float(read.options["row_spacing_s"] or 0.0)
    is_long = record.time_s[-1] - record.time_s[0] >= LONG_S
    if spacing < (SLOW_S if is_long else SLOWEST_S):
        return None
    guess = "ms" if spacing < IN_MS_S else "us"
    return Finding(
        "time-unit-not-stated",
        Light.AMBER,
        f"rows of {read.options['file']} are {spacing:.6g} s apart ({1 / spacing:.3g} Hz), and "
        f"nobody stated the unit of column {read.options['time']!r}: is it {guess}?",
        f"declare it: --time-unit {guess}, or s if it is seconds (time_unit in a study)",
    )
