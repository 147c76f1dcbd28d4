"""Parquet: columns with units in the field metadata, and flightid's own labels in the schema."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FileFormatError
from flightid.extras import extra_module
from flightid.reading import decoding
from flightid.record.formats.columns import (
    ColumnTable,
    require_distinct,
    require_readable_size,
    split_headings,
)

LABELS_KEY = b"flightid"
UNIT_KEYS = (b"unit", b"units")
WHOLE = "a whole Parquet file"
PLAIN_TYPES = ("is_integer", "is_floating", "is_boolean", "is_timestamp", "is_dictionary")

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq


def read_columns(path: Path, *, has_labels: bool = False) -> ColumnTable:
    """Columns of a Parquet file, each read when asked for.

    Parameters
    ----------
    path : Path
        The file.
    has_labels : bool
        Headings are names as they stand: units in brackets are not taken from them.

    Raises
    ------
    FileFormatError
        The file is damaged, absurdly large or repeats a name.
    OptionError
        pyarrow is not installed (extra ``parquet``).
    """
    file = _open(path)
    headings = list(file.schema_arrow.names)
    names, units = (headings, {}) if has_labels else split_headings(headings)
    require_distinct(path, names)
    of_name = dict(zip(names, headings, strict=True))
    for name, heading in of_name.items():
        metadata = file.schema_arrow.field(heading).metadata or {}
        for key in UNIT_KEYS:
            if key in metadata:
                units[name] = metadata[key].decode("utf-8", "replace")
    return ColumnTable(
        path,
        dict.fromkeys(names, file.metadata.num_rows),
        lambda name: _column(path, file, of_name[name]),
        units,
    )


def read_labels(path: Path) -> str | None:
    """The labels that flightid stored in a Parquet file; None in a file of another writer."""
    metadata = _open(path).schema_arrow.metadata or {}
    return metadata[LABELS_KEY].decode("utf-8", "replace") if LABELS_KEY in metadata else None


def parquet_library() -> Any:  # noqa: ANN401 - a module
    """`pyarrow.parquet`, for those who read or write such files."""
    return extra_module("pyarrow.parquet", "a Parquet file")


def _open(path: Path) -> pq.ParquetFile:
    pq, pa = parquet_library(), import_module("pyarrow")
    with decoding(path.name, WHOLE):
        schema = pq.read_schema(path)
        # One text of a megabyte may stand in a million rows: kept once, numbered.
        texts = [each.name for each in schema if pa.types.is_string(each.type)]
        file = pq.ParquetFile(path, read_dictionary=texts)
    if not file.metadata.num_rows:
        raise FileFormatError(f"{path.name} holds no row", needed="rows of numbers")
    require_readable_size(path, file.metadata.num_rows * max(1, file.metadata.num_columns))
    return file


def _column(path: Path, file: pq.ParquetFile, name: str) -> NDArray[Any]:
    types = import_module("pyarrow").types
    kind = file.schema_arrow.field(name).type
    # A list or a text of any length may stand in each row: one value of bounded width is a cell.
    if not any(getattr(types, is_plain)(kind) for is_plain in PLAIN_TYPES):
        raise DataError(
            f"column {name!r} of {path.name} does not hold real numbers",
            found=f"type {kind}",
            needed="numbers, times or text",
            action="leave the column out, or write it as numbers",
        )
    with decoding(path.name, WHOLE):
        column = file.read(columns=[name]).column(name)
        if types.is_dictionary(column.type):
            texts = column.unify_dictionaries().combine_chunks()
            known = texts.dictionary.to_numpy(zero_copy_only=False)
            return np.asarray(known[texts.indices.fill_null(0).to_numpy(zero_copy_only=False)])
        return _plain_values(column)


def _plain_values(column: pa.ChunkedArray) -> NDArray[Any]:
    """Values of a column; times become s from the first of them."""
    pa = import_module("pyarrow")
    if not pa.types.is_timestamp(column.type):
        return np.asarray(column.to_numpy())
    # Exact in integers; a double of seconds since 1970 would round to 0.2 µs.
    stamps = column.cast(pa.timestamp("ns")).to_numpy().astype("datetime64[ns]")
    return np.asarray((stamps - stamps[0]) / np.timedelta64(1, "s"))
