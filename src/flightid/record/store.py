"""Records to Parquet and netCDF-4 and back, with nothing lost: every bit and every label."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from flightid.errors import DataError, FileFormatError, OptionError
from flightid.files import as_path, write_atomically
from flightid.record.formats import netcdf, parquet
from flightid.record.labels import RecordLabels, from_text, labels_of, to_text
from flightid.record.options import RECORD_COLUMN
from flightid.record.record import Record
from flightid.record.several import as_records
from flightid.record.validation import TIME

if TYPE_CHECKING:
    import pyarrow as pa


def write_records(records: Record | Sequence[Record], path: str | Path) -> Path:
    """Write records to one file, whole or not at all; `read_records` gives back the same records.

    Values and stamps are kept bit for bit; so are names, units, roles, notes, trim values and
    history. The suffix chooses the format. Parquet: one table with the columns ``time_s``, the
    channels and, for several records, ``record`` (number of the record). netCDF-4: one group
    ``record_0000``, … for each record.

    Parameters
    ----------
    records : Record or sequence of Record
        At least one.
    path : str or Path
        File that ends in ``.parquet`` or ``.nc``.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    OptionError
        Another suffix; Parquet without pyarrow (extra ``parquet``).
    DataError
        No record, or a history that holds values that are not plain.
    OSError
        The folder is missing or cannot be written.

    Example
    -------
    >>> import tempfile
    >>> from flightid.record import read_records
    >>> record = Record.from_arrays([0.0, 0.5], outputs={"p": [0.1, 0.3]}, units={"p": "rad/s"})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = write_records(record, Path(folder) / "flight.parquet")
    ...     read_records(path)[0]["p"]
    array([0.1, 0.3])
    """
    target = as_path(path)
    items = list(as_records(records))
    if not items:
        raise DataError("there is no record to write", needed="at least one")
    if target.suffix.lower() == ".parquet":
        pq = parquet.parquet_library()
        table = _parquet_table(items)
        return write_atomically(
            target, lambda temporary: pq.write_table(table, temporary, compression="zstd")
        )
    if target.suffix.lower() in (".nc", ".nc4", ".netcdf"):
        return write_atomically(target, lambda temporary: _write_netcdf(temporary, items))
    raise OptionError(
        "records are not written in this format",
        found=target.suffix or "no suffix",
        needed=".parquet or .nc",
    )


def stored_records(path: Path, text: str, *, is_parquet: bool) -> list[Record]:
    """Records of a file that flightid wrote.

    Parameters
    ----------
    path : Path
        The file.
    text : str
        Its labels.
    is_parquet : bool
        Parquet rather than netCDF.

    Returns
    -------
    list of Record

    Raises
    ------
    FileFormatError
        The samples are not those the labels speak of.
    """
    labels = from_text(text, path.name)
    return _from_parquet(path, labels) if is_parquet else _from_netcdf(path, labels)


def _parquet_table(records: list[Record]) -> pa.Table:
    arrow = import_module("pyarrow")
    labels = [labels_of(record, plain_names=False) for record in records]
    names = list(dict.fromkeys(name for record in records for name in record.channels))
    columns = {TIME: arrow.array(np.concatenate([record.time_s for record in records]))}
    fields = [arrow.field(TIME, arrow.float64(), metadata={"unit": "s"})]
    if len(records) > 1 and RECORD_COLUMN not in names:
        counts = [record.n_samples for record in records]
        numbers = np.repeat(np.arange(len(records), dtype=np.int32), counts)
        columns[RECORD_COLUMN] = arrow.array(numbers)
        fields.append(arrow.field(RECORD_COLUMN, arrow.int32()))
    for name in names:
        parts = [
            arrow.array(record[name])
            if name in record
            else arrow.nulls(record.n_samples, arrow.float64())
            for record in records
        ]
        columns[name] = arrow.concat_arrays(parts)
        units = {record.unit(name) for record in records if name in record}
        metadata = {"unit": units.pop()} if len(units) == 1 else None
        fields.append(arrow.field(name, arrow.float64(), metadata=metadata))
    schema = arrow.schema(fields, metadata={parquet.LABELS_KEY: to_text(labels).encode()})
    return cast("pa.Table", arrow.table(list(columns.values()), schema=schema))


def _from_parquet(path: Path, labels: list[RecordLabels]) -> list[Record]:
    table = parquet.read_columns(path, has_labels=True)
    total = sum(item.n_samples for item in labels)
    columns = {name for item in labels for name in item.variables} | {TIME}
    if missing := columns - set(table.lengths):
        raise _changed(path, f"no column {sorted(missing)}")
    if total != table.lengths[TIME]:
        raise _changed(path, f"{table.lengths[TIME]} rows where the labels say {total}")
    values = {name: table.column(name) for name in columns}
    records = []
    first = 0
    for item in labels:
        rows = slice(first, first + item.n_samples)
        first += item.n_samples
        samples = {name: values[name][rows] for name in item.variables}
        records.append(item.record(values[TIME][rows], samples))
    return records


def _write_netcdf(path: Path, records: list[Record]) -> None:
    import h5netcdf  # noqa: PLC0415 - whoever writes none does without

    labels = [labels_of(record, plain_names=True) for record in records]
    with h5netcdf.File(path, "w") as file:
        file.attrs[netcdf.LABELS_KEY] = to_text(labels)
        for index, (record, item) in enumerate(zip(records, labels, strict=True)):
            group = file.create_group(_group_name(index))
            group.dimensions = {TIME: record.n_samples}
            stamps = group.create_variable(TIME, (TIME,), "f8", data=record.time_s)
            stamps.attrs["units"] = "s"
            for channel, variable in zip(item.channels, item.variables, strict=True):
                stored = group.create_variable(variable, (TIME,), "f8", data=record[channel.name])
                stored.attrs["units"] = channel.unit


def _from_netcdf(path: Path, labels: list[RecordLabels]) -> list[Record]:
    wanted = {_group_name(k): [TIME, *item.variables] for k, item in enumerate(labels)}
    records = []
    for item, arrays in zip(labels, netcdf.read_groups(path, wanted).values(), strict=True):
        if any(array.shape != (item.n_samples,) for array in arrays.values()):
            raise _changed(path, f"other lengths than {item.n_samples} samples")
        records.append(item.record(arrays[TIME], arrays))
    return records


def _group_name(index: int) -> str:
    return f"record_{index:04d}"


def _changed(path: Path, found: str) -> FileFormatError:
    return FileFormatError(
        f"the samples in {path.name} are not those its labels speak of",
        found=found,
        needed="the file as flightid wrote it",
        action="write it again, or remove the labels to read it as a plain table",
    )
