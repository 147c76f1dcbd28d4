"""HDF5 without its traps: no links or storage outside the file, no absurd sizes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from flightid.errors import FileFormatError
from flightid.record.formats.columns import require_readable_size

MAXIMUM_OBJECTS = 100_000


@contextmanager
def plain_datasets(path: Path) -> Iterator[Mapping[str, h5py.Dataset]]:
    """Datasets of an HDF5 file by path, links to other files left out; references (#...#) too.

    Raises
    ------
    FileFormatError
        The file is damaged, or holds too many objects or samples.
    """
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise FileFormatError(
            f"{path.name} is not a whole HDF5 file",
            found=str(error),
            action="write or copy it again",
        ) from error
    with file:
        datasets: dict[str, h5py.Dataset] = {}
        _walk(path, file, "", datasets, depth=0)
        # Each dataset alone is bounded when it is read; together they must fit as well.
        require_readable_size(path, sum(int(dataset.size or 0) for dataset in datasets.values()))
        yield datasets


def read_dataset(path: Path, dataset: h5py.Dataset) -> NDArray[Any]:
    """Values of a dataset that keeps its samples in this very file.

    Raises
    ------
    FileFormatError
        Its samples are stored in another file, or cannot be decoded.
    """
    if dataset.external or dataset.is_virtual:
        raise FileFormatError(
            f"{path.name} keeps samples in other files",
            found=f"external storage of {dataset.name}",
            needed="a file that holds its own samples",
            action="copy the data into one file",
        )
    require_readable_size(path, int(dataset.size or 0))
    try:
        return np.asarray(dataset[()])
    except OSError as error:
        raise FileFormatError(
            f"{dataset.name} of {path.name} cannot be read", found=str(error)
        ) from error


def _walk(
    path: Path, group: h5py.Group, prefix: str, found: dict[str, h5py.Dataset], depth: int
) -> None:
    for key in group:
        link = group.get(key, getlink=True)
        if key.startswith("#") or not isinstance(link, h5py.HardLink):
            continue
        if len(found) > MAXIMUM_OBJECTS or depth > 16:
            raise FileFormatError(
                f"{path.name} holds too many or too deeply nested objects",
                needed=f"at most {MAXIMUM_OBJECTS}, 16 deep",
            )
        item = group.get(key)
        if isinstance(item, h5py.Group):
            _walk(path, item, f"{prefix}{key}/", found, depth + 1)
        elif isinstance(item, h5py.Dataset):
            found[f"{prefix}{key}"] = item
