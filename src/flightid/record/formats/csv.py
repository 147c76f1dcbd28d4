"""Delimited text: one heading row, numbers below; units in brackets or in a second row."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
from pyarrow import csv as pa_csv

from flightid.errors import FileFormatError
from flightid.record.formats.columns import (
    ColumnTable,
    is_unit,
    require_distinct,
    require_readable_size,
    split_headings,
)

DELIMITERS = (",", ";", "\t")


def read_columns(path: Path) -> ColumnTable:
    """Columns of a delimited text file.

    Lines that begin with ``#`` may stand above the headings. The delimiter is the one that the
    heading row holds: comma, semicolon or tab. Beside the latter two a comma may be the decimal
    point. Numbers are read to the last bit.

    Parameters
    ----------
    path : Path
        The file, UTF-8.

    Raises
    ------
    FileFormatError
        Not UTF-8, no heading row, no numbers, two delimiters, ragged rows, repeated names.
    """
    headings, second, delimiter = _first_rows(path)
    names, units = split_headings(headings)
    require_distinct(path, names)
    has_unit_row = not units and _is_unit_row(second)
    if has_unit_row:
        units = {name: text for name, text in zip(names, second, strict=False) if text}
    # A byte makes at most one cell of a column.
    require_readable_size(path, path.stat().st_size)
    skipped = _rows_to_skip(path, 2 if has_unit_row else 1)
    table = _read(path, names, skipped, delimiter, ".")
    if delimiter != "," and _has_decimal_commas(table):
        table = _read(path, names, skipped, delimiter, ",")
    if not table.num_rows:
        raise FileFormatError(
            f"{path.name} holds headings only", needed="rows of numbers below the headings"
        )
    return ColumnTable(
        path,
        dict.fromkeys(names, table.num_rows),
        lambda name: table.column(name).to_numpy(),
        units,
    )


def _read(
    path: Path, names: list[str], skipped: int, delimiter: str, decimal_point: str
) -> pa.Table:
    try:
        # Arrow rounds decimal text correctly, refuses ragged rows, and reads in parallel.
        return pa_csv.read_csv(
            path,
            read_options=pa_csv.ReadOptions(skip_rows=skipped, column_names=names),
            parse_options=pa_csv.ParseOptions(delimiter=delimiter),
            convert_options=pa_csv.ConvertOptions(decimal_point=decimal_point),
        )
    except pa.ArrowException as error:
        raise FileFormatError(
            f"{path.name} is not a table of numbers under its headings",
            found=str(error).strip().split("\n")[0],
            needed="rows with one cell for each heading",
        ) from error


def _has_decimal_commas(table: pa.Table) -> bool:
    """Whether a column that is no number becomes one when its commas are decimal."""
    texts = [
        column.slice(0, 100).to_pylist()
        for column in table.columns
        if pa.types.is_string(column.type)
    ]
    return any(
        any("," in str(cell) for cell in cells)
        and all(_is_number(str(cell).replace(",", ".", 1)) for cell in cells if cell)
        for cells in texts
    )


def _first_rows(path: Path) -> tuple[list[str], list[str], str]:
    """Cells of the heading row and of the row below it, and the delimiter."""
    rows: list[str] = []
    try:
        with path.open(encoding="utf-8-sig") as stream:
            while len(rows) < 2 and (line := stream.readline(1 << 20)):
                if line.strip() and not line.startswith("#"):
                    rows.append(line.rstrip("\r\n"))
    except UnicodeDecodeError as error:
        raise FileFormatError(
            f"{path.name} is not text", found=str(error), needed="UTF-8"
        ) from error
    if not rows:
        raise FileFormatError(f"{path.name} holds no row", needed="a heading row and numbers")
    present = [mark for mark in DELIMITERS if mark in rows[0]]
    if len(present) > 1:
        raise FileFormatError(
            f"the heading row of {path.name} holds several delimiters",
            found=" and ".join(map(repr, present)),
            needed="one of comma, semicolon and tab",
            action="write the file with one delimiter",
        )
    delimiter = present[0] if present else ","
    headings = _cells(rows[0], delimiter)
    if all(map(_is_number, headings)):
        raise FileFormatError(
            f"{path.name} has no heading row",
            found=rows[0][:60],
            needed="names of the columns in the first row",
            action="add a row of names; no column is guessed",
        )
    return headings, _cells(rows[1], delimiter) if len(rows) > 1 else [], delimiter


def _cells(row: str, delimiter: str) -> list[str]:
    return [cell.strip().strip('"') for cell in row.split(delimiter)]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _is_unit_row(cells: list[str]) -> bool:
    """A row of units: every cell is a unit or empty or ``1``, and one at least is no number."""
    stated = [cell.strip("[]()") for cell in cells if cell]
    named = [cell for cell in stated if not _is_number(cell) and cell != "-"]
    return bool(named) and all(is_unit(cell) for cell in stated)


def _rows_to_skip(path: Path, n_rows: int) -> int:
    """Lines up to and including the first `n_rows` that are neither empty nor a comment."""
    with path.open(encoding="utf-8-sig") as stream:
        for number, line in enumerate(stream, start=1):
            if line.strip() and not line.startswith("#"):
                n_rows -= 1
            if n_rows == 0:
                return number
    return 0
