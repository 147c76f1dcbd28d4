"""Global heaps of HDF5 files, checked before the library walks them: it would not end in some.

The library steps from object to object by the size that each declares, and stands still at free
space of size zero (HDF5 2.0, `H5HG__cache_heap_deserialize`).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from flightid.errors import FileFormatError
from flightid.files import BLOCK_BYTES

SIGNATURE = b"GCOL\x01\x00\x00\x00"
HEADER = OBJECT = 16


def require_sound_heaps(path: Path) -> None:
    """Refuse a file with a global heap whose objects do not follow one another to its end.

    Raises
    ------
    FileFormatError
        A heap is longer than the file, or an object ends before it begins or beyond its heap.

    Reference
    ---------
    The HDF Group, *HDF5 File Format Specification* 3.0, III.E (with sizes of 8 bytes).
    """
    with path.open("rb") as stream:
        for place in _places(stream):
            stream.seek(place + len(SIGNATURE))
            size = int.from_bytes(stream.read(8), "little")
            if not _is_sound(stream, place, size):
                raise FileFormatError(
                    f"{path.name} is not a whole HDF5 file",
                    found=f"a heap of {size} bytes at {place} whose objects have no end",
                    action="write or copy it again",
                )


def _places(stream: BinaryIO) -> Iterator[int]:
    """Where heaps begin."""
    begin, tail = 0, b""
    while True:
        stream.seek(begin + len(tail))
        if not (block := stream.read(BLOCK_BYTES)):
            return
        text = tail + block
        at = text.find(SIGNATURE)
        while at >= 0:
            yield begin + at
            at = text.find(SIGNATURE, at + 1)
        tail = text[1 - len(SIGNATURE) :]
        begin += len(text) - len(tail)


def _is_sound(stream: BinaryIO, place: int, size: int) -> bool:
    at, end = place + HEADER, place + size
    while at + OBJECT <= end:
        stream.seek(at)
        if len(head := stream.read(OBJECT)) < OBJECT:
            return False
        number, _, _, length = struct.unpack("<HHIQ", head)
        # The size of free space (number 0) counts its own head; that of an object does not.
        taken = OBJECT + length + -length % 8 if number else length
        if taken < OBJECT or at + taken > end:
            return False
        at += taken
    return True
