"""MATLAB .mat: numeric arrays and fields of plain structures; objects are never built.

Level 5 to 7.2 through SciPy, 7.3 (an HDF5 file) through h5py. Columns of a matrix are named
``y_1``, ``y_2``, …; fields of a structure ``data.p``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import FileFormatError
from flightid.reading import bounded_bytes, decoding, memory_budget
from flightid.record.formats.columns import ColumnTable
from flightid.record.formats.hdf5 import plain_datasets, read_dataset
from flightid.record.formats.matlab_bytes import inflated

NUMERIC = {
    *("double", "single", "logical"),
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
}


def read_columns(path: Path) -> ColumnTable:
    """Columns of a level 5 to 7.2 .mat file.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    FileFormatError
        The file is damaged, absurdly large, or holds no numeric array.
    """
    plain: Any = inflated(path.name, bounded_bytes(path, memory_budget()))
    with decoding(path.name, "a whole MATLAB file", "save it again with save -v7"):
        inside = scipy.io.whosmat(plain)
        wanted = [name for name, _, kind in inside if kind in NUMERIC or kind == "struct"]
        # Structures come as plain record arrays and objects are not asked for: nothing is called.
        content = scipy.io.loadmat(plain, variable_names=wanted, struct_as_record=True)
    columns: dict[str, NDArray[Any]] = {}
    for name in wanted:
        _add(columns, name, content.get(name))
    return _table(path, columns)


def read_hdf5_columns(path: Path) -> ColumnTable:
    """Columns of a 7.3 .mat file.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    FileFormatError
        The file is damaged, absurdly large, points to other files, or holds no numeric array.
    """
    columns: dict[str, NDArray[Any]] = {}
    with plain_datasets(path) as datasets:
        for key, dataset in datasets.items():
            with decoding(path.name, "a whole MATLAB file"):
                is_numeric = _is_numeric(dataset)
            if is_numeric:
                # MATLAB writes column-major arrays, so HDF5 shows them transposed.
                _add(columns, key.replace("/", "."), read_dataset(path, dataset).T)
    return _table(path, columns)


def _is_numeric(dataset: h5py.Dataset) -> bool:
    kind = dataset.attrs.get("MATLAB_class", b"double")
    text = kind.decode() if isinstance(kind, bytes) else str(kind)
    return text in NUMERIC and dataset.dtype.kind in "fiub" and "MATLAB_empty" not in dataset.attrs


def _add(columns: dict[str, NDArray[Any]], name: str, value: object) -> None:
    """Add an array's columns under its name, and a structure's fields under theirs."""
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            _add(columns, f"{name}.{field}", value.reshape(-1)[0][field])
    elif value.dtype.kind in "fiub" and value.ndim <= 2 and value.size > 1:
        if value.ndim < 2 or 1 in value.shape:
            columns[name] = value.reshape(-1)
        else:
            for index in range(value.shape[1]):
                columns[f"{name}_{index + 1}"] = value[:, index]


def _table(path: Path, columns: dict[str, NDArray[Any]]) -> ColumnTable:
    if not columns:
        raise FileFormatError(
            f"{path.name} holds no numeric array",
            needed="vectors of one length, a matrix of columns, or a structure of them",
            action="save timetables and objects as plain arrays",
        )
    return ColumnTable(path, {key: v.size for key, v in columns.items()}, lambda key: columns[key])
