"""MATLAB .mat: numeric arrays and fields of plain structures; objects are never built.

Level 5 to 7.2 through SciPy, 7.3 (an HDF5 file) through h5py. Columns of a matrix are named
``y_1``, ``y_2``, …; fields of a structure ``data.p``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import FileFormatError
from flightid.reading import bounded_bytes, decoding, memory_budget
from flightid.record.formats.columns import ColumnTable
from flightid.record.formats.hdf5 import plain_datasets, read_dataset
from flightid.record.formats.matlab_bytes import inflated

if TYPE_CHECKING:
    import h5py

PLAIN = "save its numbers as plain arrays"
WAYS = {
    "timetable": "T = timetable2table({0}, 'ConvertRowTimes', false); t = {0}.Properties.RowTimes; "
    "T.time = seconds(t - t(1)); writetable(T, '{0}.csv')",
    "table": "writetable({0}, '{0}.csv'), or s = table2struct({0}, 'ToScalar', true), and save s",
    "timeseries": "time = {0}.Time; y = squeeze({0}.Data); and save those",
}
"""How objects of a class become columns."""
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
    plain: Any
    plain, objects = inflated(path.name, bounded_bytes(path, memory_budget()))
    with decoding(path.name, "a whole MATLAB file", "save it again with save -v7"):
        inside = scipy.io.whosmat(plain)
        wanted = [name for name, _, kind in inside if kind in NUMERIC or kind == "struct"]
        # Structures come as plain record arrays and objects are not asked for: nothing is called.
        content = scipy.io.loadmat(plain, variable_names=wanted, struct_as_record=True)
    columns: dict[str, NDArray[Any]] = {}
    for name in wanted:
        _add(columns, name, content.get(name))
    return _table(path, columns, objects)


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
    objects: dict[str, str] = {}
    with plain_datasets(path) as datasets:
        for key, dataset in datasets.items():
            with decoding(path.name, "a whole MATLAB file"):
                is_numeric = _is_numeric(dataset)
                if "MATLAB_object_decode" in dataset.attrs:
                    objects[key] = _class(dataset)
            if is_numeric:
                # MATLAB writes column-major arrays, so HDF5 shows them transposed.
                _add(columns, key.replace("/", "."), read_dataset(path, dataset).T)
    return _table(path, columns, objects)


def _class(dataset: h5py.Dataset) -> str:
    kind = dataset.attrs.get("MATLAB_class", b"double")
    return kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)


def _is_numeric(dataset: h5py.Dataset) -> bool:
    is_number = _class(dataset) in NUMERIC and dataset.dtype.kind in "fiub"
    return is_number and "MATLAB_empty" not in dataset.attrs


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


def _table(path: Path, columns: dict[str, NDArray[Any]], objects: Mapping[str, str]) -> ColumnTable:
    advice = "; ".join(
        f"{name} is a MATLAB {kind}, an object: in MATLAB, {WAYS.get(kind, PLAIN).format(name)}"
        for name, kind in objects.items()
    )
    if not columns:
        raise FileFormatError(
            f"{path.name} holds no numeric array",
            found=", ".join(f"{name}, a {kind}" for name, kind in objects.items()) or None,
            needed="vectors of one length, a matrix of columns, or a structure of them",
            action=advice or "save timetables and objects as plain arrays",
        )
    lengths = {key: values.size for key, values in columns.items()}
    return ColumnTable(path, lengths, columns.__getitem__, advice=advice)
