"""netCDF, classic and netCDF-4: one-dimensional variables with their `units` attribute."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np

from flightid.errors import FileFormatError
from flightid.reading import decoding
from flightid.record.formats.columns import ColumnTable, require_readable_size
from flightid.record.formats.hdf5 import plain_datasets, read_dataset

LABELS_KEY = "flightid"
SINCE = re.compile(r"^(?P<unit>\w+) since .*$")


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
    """
    import xarray as xr  # noqa: PLC0415  # half a second that other formats do not need

    if not classic:
        with plain_datasets(path) as datasets:
            for dataset in datasets.values():
                _require_own_storage(path, dataset)
    engine = "scipy" if classic else "h5netcdf"
    with (
        decoding(path.name, "a whole netCDF file"),
        xr.open_dataset(path, engine=engine, decode_times=False) as source,
    ):
        flat = {str(key): item for key, item in source.variables.items() if item.ndim == 1}
        require_readable_size(path, sum(item.size for item in flat.values()))
        values = {key: np.asarray(item.values) for key, item in flat.items()}
        units = {
            key: SINCE.sub(r"\g<unit>", str(item.attrs["units"]))
            for key, item in flat.items()
            if "units" in item.attrs
        }
    return ColumnTable(
        path, {key: item.size for key, item in values.items()}, lambda key: values[key], units
    )


def read_labels(path: Path) -> str | None:
    """The labels that flightid stored in a netCDF-4 file; None in a file of another writer."""
    with plain_datasets(path) as datasets:
        dataset = next(iter(datasets.values()), None)
        if dataset is None:
            return None
        with decoding(path.name, "a whole netCDF file"):
            value = dataset.file.attrs.get(LABELS_KEY)
    return value if isinstance(value, str) else None


def read_group(path: Path, group: str, names: list[str]) -> dict[str, np.ndarray]:
    """Arrays of one group, bit for bit.

    Raises
    ------
    FileFormatError
        A variable is missing.
    """
    with plain_datasets(path) as datasets:
        missing = [name for name in names if f"{group}/{name}" not in datasets]
        if missing:
            raise FileFormatError(
                f"{path.name} lacks variables that its labels name",
                found=f"no {', '.join(missing)} in group {group}",
                action="the file was changed by another program: write it again",
            )
        return {name: read_dataset(path, datasets[f"{group}/{name}"]) for name in names}


def _require_own_storage(path: Path, dataset: h5py.Dataset) -> None:
    if dataset.external or dataset.is_virtual:
        raise FileFormatError(
            f"{path.name} keeps samples in other files",
            found=f"external storage of {dataset.name}",
            needed="a file that holds its own samples",
        )
