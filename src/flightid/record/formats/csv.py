"""Delimited text: one heading row, numbers below; units in brackets or in a second row."""

from __future__ import annotations

import codecs
import csv
import re
from pathlib import Path

import pyarrow as pa
from pyarrow import csv as pa_csv

from flightid.errors import FileFormatError
from flightid.files import BLOCK_BYTES
from flightid.record.formats.columns import (
    ColumnTable,
    is_unit,
    require_distinct,
    require_readable_size,
    split_headings,
)
from flightid.record.formats.parquet import plain_values

DELIMITERS = (",", ";", "\t")
LONGEST_LINE = 1 << 20
QUOTED = re.compile(r'"[^"]*"')


def read_columns(path: Path) -> ColumnTable:
    """Columns of a delimited text file.

    Lines that begin with ``#`` may stand above the headings. The delimiter is the one that the
    heading row holds: comma, semicolon or tab. Beside the latter two a comma may be the decimal
    point. Quotes may hold delimiters; dates (2024-05-01T10:00:00) become s from the first row.
    Numbers are read to the last bit.

    Parameters
    ----------
    path : Path
        The file, UTF-8, or UTF-16 with its mark.

    Raises
    ------
    FileFormatError
        Another encoding, no heading row, a line above 1 MiB, no numbers, two delimiters, ragged
        rows, repeated names, more cells than the memory budget holds.
    """
    encoding = _encoding(path)
    headings, second, delimiter, lines = _first_rows(path, encoding)
    names, units = split_headings(headings)
    require_distinct(path, names)
    has_unit_row = not units and _is_unit_row(second)
    if has_unit_row:
        units = {name: text for name, text in zip(names, second, strict=False) if text}
    require_readable_size(path, _most_cells(path, delimiter.encode()))
    skipped = lines[1] if has_unit_row else lines[0]
    table = _read(path, names, skipped, delimiter, ".", encoding)
    if delimiter != "," and _has_decimal_commas(table):
        table = _read(path, names, skipped, delimiter, ",", encoding)
    if not table.num_rows:
        raise FileFormatError(
            f"{path.name} holds headings only", needed="rows of numbers below the headings"
        )
    return ColumnTable(
        path,
        dict.fromkeys(names, table.num_rows),
        lambda name: plain_values(table.column(name)),
        units,
    )


def _read(
    path: Path, names: list[str], skipped: int, delimiter: str, point: str, encoding: str
) -> pa.Table:
    try:
        # Arrow rounds decimal text correctly, refuses ragged rows, and reads in parallel.
        return pa_csv.read_csv(
            path,
            read_options=pa_csv.ReadOptions(
                skip_rows=skipped, column_names=names, encoding=encoding
            ),
            parse_options=pa_csv.ParseOptions(delimiter=delimiter),
            convert_options=pa_csv.ConvertOptions(decimal_point=point),
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


def _most_cells(path: Path, delimiter: bytes) -> int:
    """Every cell ends with a delimiter or a line; those inside quotes are counted too."""
    cells = 1
    with path.open("rb") as stream:
        while block := stream.read(BLOCK_BYTES):
            cells += block.count(delimiter) + max(block.count(b"\n"), block.count(b"\r"))
    return cells


def _encoding(path: Path) -> str:
    with path.open("rb") as stream:
        mark = stream.read(2)
    return "utf-16" if mark in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8"


def _first_rows(path: Path, encoding: str) -> tuple[list[str], list[str], str, list[int]]:
    """Cells of the heading row and of the row below it, the delimiter, where both stand."""
    rows: list[str] = []
    lines: list[int] = []
    number = 0
    try:
        with path.open(encoding="utf-8-sig" if encoding == "utf-8" else encoding) as stream:
            while len(rows) < 2 and (line := stream.readline(LONGEST_LINE)):
                number += 1
                if len(line) == LONGEST_LINE:
                    raise FileFormatError(
                        f"line {number} of {path.name} is longer than a row can be",
                        needed=f"at most {LONGEST_LINE} characters",
                    )
                if line.strip() and not line.startswith("#"):
                    rows.append(line.rstrip("\r\n"))
                    lines.append(number)
    except UnicodeError as error:
        raise FileFormatError(
            f"{path.name} is not text", found=str(error), needed="UTF-8 or UTF-16"
        ) from error
    if not rows:
        raise FileFormatError(f"{path.name} holds no row", needed="a heading row and numbers")
    bare = QUOTED.sub("", rows[0])
    present = [mark for mark in DELIMITERS if mark in bare]
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
    return headings, _cells(rows[1], delimiter) if len(rows) > 1 else [], delimiter, lines


def _cells(row: str, delimiter: str) -> list[str]:
    cells = next(csv.reader([row], delimiter=delimiter, skipinitialspace=True), [])
    return [cell.strip() for cell in cells]


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
