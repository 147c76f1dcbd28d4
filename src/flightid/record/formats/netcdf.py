"""netCDF, classic and netCDF-4: one-dimensional variables with their `units` attribute."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import FileFormatError
from flightid.reading import decoding, require_memory
from flightid.record.formats.columns import ColumnTable, require_readable_size
from flightid.record.formats.hdf5 import plain_datasets, read_dataset

LABELS_KEY = "flightid"
SINCE = re.compile(r"^(?P<unit>\w+) since .*$")
WHOLE = "a whole netCDF file"
NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"

Variables = dict[str, tuple[NDArray[Any], Mapping[str, Any]]]


def read_columns(path: Path, *, classic: bool) -> ColumnTable:
    """Columns of a netCDF file: its one-dimensional variables, scale and fill values applied.

    Parameters
    ----------
    path : Path
        The file.
    classic : bool
        Classic netCDF rather than netCDF-4.

    Raises
    ------
    FileFormatError
        The file is damaged, absurdly large or points to other files.

    Reference
    ---------
    NetCDF Users Guide, appendix A: `_FillValue`, `missing_value`, `scale_factor`, `add_offset`.
    """
    variables = _classic_variables(path) if classic else _variables(path)
    require_readable_size(path, sum(values.size for values, _ in variables.values()))
    with decoding(path.name, WHOLE):
        values = {name: _decoded(*stored) for name, stored in variables.items()}
        units = {
            name: SINCE.sub(r"\g<unit>", _text(attributes["units"]))
            for name, (_, attributes) in variables.items()
            if "units" in attributes
        }
    lengths = {name: item.size for name, item in values.items()}
    return ColumnTable(path, lengths, values.__getitem__, units)


def read_labels(path: Path) -> str | None:
    """The labels that flightid stored in a netCDF-4 file; None in a file of another writer."""
    with plain_datasets(path) as datasets:
        dataset = next(iter(datasets.values()), None)
        if dataset is None:
            return None
        with decoding(path.name, WHOLE):
            value = dataset.file.attrs.get(LABELS_KEY)
    return value if isinstance(value, str) else None


def read_groups(path: Path, groups: Mapping[str, list[str]]) -> dict[str, dict[str, np.ndarray]]:
    """Arrays of some groups by name, bit for bit; the file is opened once.

    Parameters
    ----------
    path : Path
    groups : mapping of str to list of str
        Variables by group.

    Raises
    ------
    FileFormatError
        A variable is missing.
    """
    with plain_datasets(path) as datasets:
        for group, names in groups.items():
            missing = [name for name in names if f"{group}/{name}" not in datasets]
            if missing:
                raise FileFormatError(
                    f"{path.name} lacks variables that its labels name",
                    found=f"no {', '.join(missing)} in group {group}",
                    action="the file was changed by another program: write it again",
                )
        return {
            group: {name: read_dataset(path, datasets[f"{group}/{name}"]) for name in names}
            for group, names in groups.items()
        }


def _variables(path: Path) -> Variables:
    """Variables of the root group of a netCDF-4 file."""
    found: Variables = {}
    with plain_datasets(path) as datasets:
        for name, dataset in datasets.items():
            with decoding(path.name, WHOLE):
                attributes = {
                    key: dataset.attrs[key]
                    for key in (*NUMBERS, "units", "_Unsigned", "NAME")
                    if key in dataset.attrs
                }
                is_row = dataset.ndim == 1 and "/" not in name
                is_row = is_row and not _text(attributes.get("NAME", "")).startswith(NO_VARIABLE)
            if is_row:
                found[name] = read_dataset(path, dataset), attributes
    return found


def _classic_variables(path: Path) -> Variables:
    # Twice: the library copies what it reads.
    require_memory(path.name, 2 * path.stat().st_size)
    with decoding(path.name, WHOLE), scipy.io.netcdf_file(path, "r", mmap=False) as file:
        return {
            str(name): (_letters_joined(np.array(item.data)), vars(item)["_attributes"])
            for name, item in file.variables.items()
            if np.ndim(item.data) == 1 or (np.ndim(item.data) == 2 and item.data.dtype.char == "c")
        }


def _letters_joined(values: NDArray[Any]) -> NDArray[Any]:
    """Texts of a matrix of letters, a row each; other arrays in this machine's order."""
    if values.ndim == 2:
        return np.ascontiguousarray(values).view(f"S{values.shape[1]}").reshape(-1)
    return values.astype(values.dtype.newbyteorder("="))


NUMBERS = ("_FillValue", "missing_value", "scale_factor", "add_offset")


def _decoded(values: NDArray[Any], attributes: Mapping[str, Any]) -> NDArray[Any]:
    """Values as their attributes mean them: texts as text, what is missing as not-a-number."""
    if values.dtype.kind in "SO":
        texts = [_text(value).rstrip("\0 ") for value in values]
        return np.array(texts, dtype=object)
    if values.dtype.kind == "i" and _text(attributes.get("_Unsigned", "")) == "true":
        values = values.view(f"u{values.dtype.itemsize}")
    stated = {key: np.ravel(attributes[key]) for key in NUMBERS if key in attributes}
    if values.dtype.kind not in "iuf" or not stated:
        return values
    made = values.astype(np.float64)
    scale, offset = stated.get("scale_factor", (1.0,)), stated.get("add_offset", (0.0,))
    for key in NUMBERS[:2]:
        if key in stated:
            made[np.isin(values, stated[key].astype(values.dtype))] = np.nan
    return np.asarray(made * float(scale[0]) + float(offset[0]))


def _text(value: object) -> str:
    """Text of an attribute, whatever its writer made of it."""
    first = value.reshape(-1)[0] if isinstance(value, np.ndarray) and value.size else value
    return first.decode("utf-8", "replace") if isinstance(first, bytes) else str(first)
