"""A file as columns: opened by its format, and named."""

from __future__ import annotations

import csv as texts
from collections.abc import Iterable, Sequence
from pathlib import Path

from flightid.record.formats import ColumnTable, FileFormat, csv, matlab, netcdf, ros
from flightid.record.formats import parquet as parquet_format


def read_table(path: Path, kind: FileFormat, column_names: Iterable[str]) -> ColumnTable:
    """Columns of a file of samples.

    Parameters
    ----------
    path : Path
        The file.
    kind : FileFormat
        What it is.
    column_names : iterable of str
        Names of the columns in their order, one a text or with commas between them.

    Raises
    ------
    OptionError
        Not one name for each column.
    FileFormatError, DataError
        The file cannot be read.
    """
    names = [cell.strip() for row in texts.reader(column_names) for cell in row]
    return _opened(path, kind, names)


def _opened(path: Path, kind: FileFormat, names: Sequence[str]) -> ColumnTable:
    if kind is FileFormat.CSV:
        return csv.read_columns(path, names)
    if kind is FileFormat.PARQUET:
        table = parquet_format.read_columns(path)
    elif kind is FileFormat.MATLAB:
        table = matlab.read_columns(path)
    elif kind is FileFormat.BAG:
        table = ros.read_columns(path)
    elif kind is FileFormat.MATLAB_HDF5:
        table = matlab.read_hdf5_columns(path)
    else:
        table = netcdf.read_columns(path, classic=kind is FileFormat.NETCDF_CLASSIC)
    return table.named(names) if names else table
