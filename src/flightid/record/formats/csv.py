"""Delimited text: a heading row or none, numbers below; units in brackets or a second row."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import FileFormatError
from flightid.findings import counted
from flightid.reading import memory_budget, within_memory
from flightid.record.formats.columns import (
    ColumnTable,
    is_unit,
    require_distinct,
    require_one_each,
    split_headings,
)
from flightid.record.formats.foreign import NO_DATA

DELIMITERS = (",", ";", "\t")
LONGEST_LINE = 1 << 20
WINDOWS = "Windows-1252"
"""What spreadsheets of western Europe write where they do not write UTF-8; Latin-1 is within it."""
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:")
QUOTED = re.compile(r'"[^"]*"')
MOST_HEADING_LINES = 1000
OPEN_QUOTE = re.compile(r'(?:^|[,;\t])[ ]*"[^"]*$')


def read_columns(path: Path, headings: Sequence[str] = ()) -> ColumnTable:
    """Columns of a delimited text file.

    Lines that begin with ``#`` may stand above the headings. The delimiter is the one that the
    heading row holds: comma, semicolon or tab. Beside the latter two a comma may be the decimal
    point. Quotes may hold delimiters; dates (2024-05-01T10:00:00) become s from the first row.
    Numbers are read to the last bit; empty cells and NA are not-a-number, true and false 1 and 0.

    Parameters
    ----------
    path : Path
        The file, UTF-8, or UTF-16 with its mark; what is neither and holds no zero byte is
        Windows-1252, and the table says so.
    headings : sequence of str
        Used in place of those of the file, which then need not have any: a first row that holds a
        number is a row of samples.

    Raises
    ------
    OptionError
        Not one heading for each column.
    FileFormatError
        Another encoding, no heading row and no `headings`, a line above 1 MiB, no numbers, text
        alone, two delimiters, ragged rows, repeated names, more cells than the memory budget holds.
    """
    encoding = _encoding(path)
    first, second, delimiter, lines = _first_rows(path, encoding)
    has_headings = not any(map(_is_number, first))
    if not headings and not has_headings and all(map(_may_be_sample, first)):
        raise FileFormatError(
            f"{path.name} has no heading row",
            found=", ".join(first)[:60],
            needed="names of the columns in the first row, or column_names, one for each column",
            action="name them in their order, --columns time,u,y; no column is guessed",
        )
    if headings:
        require_one_each(path, headings, first)
    names, units = split_headings(headings or first)
    require_distinct(path, names)
    is_bare = bool(headings) and not has_headings
    has_unit_row = not units and not is_bare and _is_unit_row(second)
    if has_unit_row:
        units = {name: text for name, text in zip(names, second, strict=False) if text}
    skipped = lines[0] - 1 if is_bare else lines[1] if has_unit_row else lines[0]
    columns = _columns(path, skipped, len(names), delimiter, encoding)
    n_rows = columns[0].size
    if not n_rows:
        raise FileFormatError(
            f"{path.name} holds headings only", needed="rows of numbers below the headings"
        )
    if all(column.dtype.kind == "O" for column in columns):
        raise FileFormatError(
            f"{path.name} holds no table of numbers",
            found=f"text alone in {counted(n_rows, 'row')} of {counted(len(names), 'column')}",
            needed="one column of numbers at least, below its name",
            action=NO_DATA,
        )
    by_name = dict(zip(names, columns, strict=True))
    dates = {name: "s" for name, text in zip(names, second, strict=False) if DATE.match(text)}
    units = {**dates, **units}
    lengths = dict.fromkeys(names, n_rows)
    said = encoding if encoding == WINDOWS else ""
    return ColumnTable(path, lengths, by_name.__getitem__, units, encoding=said)


def _columns(
    path: Path, skipped: int, n_columns: int, delimiter: str, encoding: str
) -> list[NDArray[Any]]:
    try:
        with within_memory(path.name):
            read = _native.read_delimited(
                str(path), skipped, n_columns, delimiter, encoding == "utf-16", memory_budget()
            )
    except ValueError as fault:
        raise FileFormatError(
            f"{path.name} is not a table of numbers under its headings",
            found=str(fault),
            needed="rows with one cell for each heading",
        ) from fault
    return [
        np.array(texts, dtype=object)[codes] if numbers is None else numbers
        for numbers, codes, texts in read
    ]


def _encoding(path: Path) -> str:
    with path.open("rb") as stream:
        if stream.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
            return "utf-16"
        stream.seek(0)
        decoder = codecs.getincrementaldecoder("utf-8")()
        is_utf8 = True
        while block := stream.read(LONGEST_LINE):
            if b"\0" in block:
                return "utf-8"
            if block.isascii() and not decoder.getstate()[0]:
                continue  # nothing to decode, and no character begun before
            try:
                decoder.decode(block)
            except UnicodeDecodeError:
                is_utf8 = False
    return "utf-8" if is_utf8 else WINDOWS


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
                if not rows and not line.startswith("#"):
                    # A heading in quotes may hold line ends (RFC 4180); its name has a blank.
                    while _is_open(line):
                        more = stream.readline(LONGEST_LINE - len(line))
                        number += 1
                        if not more or number > MOST_HEADING_LINES:
                            raise FileFormatError(
                                f"the heading row of {path.name} opens a quote that does not end",
                                found=line[:60].strip(),
                                needed="a quote at both ends of a name",
                            )
                        line = f"{line.rstrip()} {more.lstrip()}"
                if line.strip() and not line.startswith("#"):
                    rows.append(line.rstrip("\r\n"))
                    lines.append(number)
    except UnicodeError as error:
        raise FileFormatError(
            f"{path.name} is not text",
            found=str(error),
            needed="UTF-8, UTF-16 or Windows-1252",
        ) from error
    if not rows:
        raise FileFormatError(f"{path.name} holds no row", needed="a heading row and numbers")
    bare = QUOTED.sub("", rows[0])
    present = [mark for mark in DELIMITERS if mark in bare]
    if present[0:1] == [","] and all(map(_may_be_sample, _cells(rows[0], present[-1]))):
        present = present[-1:]  # decimal commas of a row of samples
    if len(present) > 1:
        raise FileFormatError(
            f"the heading row of {path.name} holds several delimiters",
            found=" and ".join(map(repr, present)),
            needed="one of comma, semicolon and tab",
            action="write the file with one delimiter",
        )
    delimiter = present[0] if present else ","
    first, second = _cells(rows[0], delimiter), _cells(rows[1], delimiter) if rows[1:] else []
    return first, second, delimiter, lines


def _is_open(row: str) -> bool:
    return bool(OPEN_QUOTE.search(QUOTED.sub("", row)))


def _cells(row: str, delimiter: str) -> list[str]:
    try:
        cells = next(csv.reader([row], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error as error:
        raise FileFormatError(
            "a row of the file cannot be cut into cells",
            found=f"{error}, in a row of {len(row)} characters",
            needed=f"cells of at most {csv.field_size_limit()} characters",
            action="look at the first rows: a text is no heading or a quote does not end",
        ) from error
    return [cell.strip() for cell in cells]


def _may_be_sample(text: str) -> bool:
    return text in ("", "NA") or bool(DATE.match(text)) or _is_number(text)


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _is_unit_row(cells: list[str]) -> bool:
    """A row of units: every cell is a unit or empty or ``1``, and one at least is no number."""
    stated = [cell.strip("[]()") for cell in cells if cell]
    named = [cell for cell in stated if not _is_number(cell) and cell != "-"]
    return bool(named) and all(is_unit(cell) for cell in stated)
