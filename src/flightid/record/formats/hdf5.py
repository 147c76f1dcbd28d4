"""HDF5 without its traps: no links or storage outside the file, no absurd sizes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FileFormatError
from flightid.reading import decoding, require_memory
from flightid.record.formats.columns import VALUE_BYTES
from flightid.record.formats.hdf5_heaps import require_sound_heaps

if TYPE_CHECKING:
    import h5py

MAXIMUM_OBJECTS = 100_000
DEEPEST = 16
WHOLE = "a whole HDF5 file"


@contextmanager
def plain_datasets(path: Path) -> Iterator[Mapping[str, h5py.Dataset]]:
    """Datasets of an HDF5 file by path, links to other files left out; references (#...#) too.

    Raises
    ------
    FileFormatError
        The file is damaged, or holds too many objects or samples.
    """
    import h5py  # noqa: PLC0415 - whoever reads other files does without

    require_sound_heaps(path)
    with decoding(path.name, WHOLE):
        file = h5py.File(path, "r")
    with file:
        datasets: dict[str, h5py.Dataset] = {}
        with decoding(path.name, WHOLE):
            _walk(path, file, "", datasets, seen={_place(file)})
            # What is declared may have no samples behind it: fill values take no room in a file.
            require_memory(path.name, sum(map(_declared_bytes, datasets.values())))
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
    with decoding(path.name, WHOLE):
        return np.asarray(dataset[()])


def _declared_bytes(dataset: h5py.Dataset) -> int:
    """What a dataset takes once it is read, and what one block of its storage takes."""
    width = int(dataset.id.get_type().get_size())
    count = int(dataset.id.get_space().get_simple_extent_npoints())
    return count * max(width, VALUE_BYTES) + prod(dataset.chunks or ()) * width


def _place(group: h5py.Group) -> int:
    """Where a group stands in its file, whatever names lead to it."""
    import h5py  # noqa: PLC0415 - as above

    return int(h5py.h5o.get_info(group.id).addr)


def _walk(
    path: Path, group: h5py.Group, prefix: str, found: dict[str, h5py.Dataset], seen: set[int]
) -> None:
    """Add the datasets below a group; a group that several names lead to is entered once."""
    import h5py  # noqa: PLC0415 - as above

    for key in group:
        link = group.get(key, getlink=True)
        if key.startswith("#") or not isinstance(link, h5py.HardLink):
            continue
        if len(found) + len(seen) > MAXIMUM_OBJECTS or prefix.count("/") > DEEPEST:
            raise FileFormatError(
                f"{path.name} holds too many or too deeply nested objects",
                needed=f"at most {MAXIMUM_OBJECTS}, {DEEPEST} deep",
            )
        item = group.get(key)
        if isinstance(item, h5py.Group):
            place = _place(item)
            if place not in seen:
                seen.add(place)
                _walk(path, item, f"{prefix}{key}/", found, seen)
        elif isinstance(item, h5py.Dataset):
            found[f"{prefix}{key}"] = item
