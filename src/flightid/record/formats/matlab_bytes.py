"""Level 5 MATLAB files, inflated, every declared size checked before a decoder sees them."""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import field
from math import prod

from flightid.errors import FileFormatError
from flightid.frozen import dataclass
from flightid.reading import memory_budget, require_memory

HEADER = 128
MATRIX, COMPRESSED = 14, 15
CELL, STRUCT, OBJECT = 1, 2, 3
WIDTHS = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes of one number by storage type; numbers become doubles."""
ELEMENT_BYTES = 256
"""What a decoder makes of one array, however empty."""
OPAQUE = 17
DEEPEST = 32


def inflated(name: str, content: bytes) -> tuple[io.BytesIO, dict[str, str]]:
    """A level 5 MATLAB file without compression, whose arrays hold what they declare.

    A decoder allocates what an array declares before it reads it: a structure of 10⁹ fields takes
    56 bytes. Here every element must lie inside the one that holds it, arrays of arrays must have
    room for their members, and what all numbers take stays within the memory budget. Objects, such
    as timetables, are left out with the bytes they refer to: no reader of plain arrays knows them.

    Parameters
    ----------
    name : str
        Of the file.
    content : bytes
        Of the file.

    Returns
    -------
    file : BytesIO
    objects : dict of str to str
        Class of each object that was left out, by name.

    Raises
    ------
    FileFormatError
        An element is cut, nested deeper than `DEEPEST`, or too large.

    Reference
    ---------
    MathWorks, *MAT-File Format* (level 5), section 1.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[126:HEADER])
    if order is None or 0 in content[:4]:
        raise FileFormatError(f"{name} is not a MATLAB file of level 5")
    walk = _Elements(name, order)
    view, parts, at = memoryview(content), [content[:HEADER]], HEADER
    try:
        while at < len(content):
            kind, first, last, _ = walk.tag(view, at)
            is_packed = kind == COMPRESSED
            inner = walk.inflate(view[first:last]) if is_packed else bytes(view[at:last])
            walk.is_plain = True
            walk.element(memoryview(inner), 0, 0)
            parts += [inner] * walk.is_plain
            at = last
    except (struct.error, zlib.error) as error:
        raise FileFormatError(
            f"{name} is not a whole MATLAB file",
            found=str(error),
            action="save it again with save -v7",
        ) from error
    return io.BytesIO(b"".join(parts)), walk.objects


@dataclass
class _Elements:
    """Elements of a file, and what they take together."""

    name: str
    order: str
    taken: int = 0
    is_plain: bool = True
    objects: dict[str, str] = field(default_factory=dict)

    def take(self, n_bytes: int) -> None:
        """Count bytes against the budget."""
        self.taken += n_bytes
        require_memory(self.name, self.taken)

    def fault(self, found: str) -> FileFormatError:
        return FileFormatError(
            f"{self.name} is not a whole MATLAB file",
            found=found,
            needed="level 5 to 7.3",
            action="save it again with save -v7",
        )

    def inflate(self, data: memoryview) -> bytes:
        stream = zlib.decompressobj()
        made = stream.decompress(data, memory_budget() - self.taken + 1)
        self.take(len(made))
        if not stream.eof:
            raise self.fault("a compressed element that is cut")
        return made

    def tag(self, view: memoryview, at: int) -> tuple[int, int, int, int]:
        """Type, first and last byte of an element, and where the next one begins."""
        kind, size = struct.unpack_from(f"{self.order}II", view, at)
        if kind >> 16:
            kind, size, first, following = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            is_cut = size > 4
        else:
            first, following = at + 8, at + 8 + size + (-size % 8)
            is_cut = first + size > len(view)
        if kind not in WIDTHS and kind not in (MATRIX, COMPRESSED):
            # SciPy looks an unknown type up beyond the end of its table: the process ends.
            raise self.fault(f"an element of type {kind}")
        if is_cut:
            raise self.fault(f"an element of {size} bytes where {len(view) - at} are left")
        return kind, first, first + size, following

    def element(self, view: memoryview, at: int, depth: int) -> int:
        """Walk one element; where the next one begins."""
        kind, first, last, following = self.tag(view, at)
        if kind != MATRIX:
            self.take((last - first) * 8 // WIDTHS.get(kind, 1))
        elif first < last:
            if depth > DEEPEST:
                raise self.fault(f"arrays nested deeper than {DEEPEST}")
            self._matrix(view[first:last], depth)
        return following

    def _matrix(self, view: memoryview, depth: int) -> None:
        self.take(ELEMENT_BYTES)
        _, flags, _, at = self.tag(view, 0)
        kind = struct.unpack_from(f"{self.order}I", view, flags)[0] & 0xFF
        if not 1 <= kind <= OPAQUE:
            raise self.fault(f"an array of class {kind}")
        _, first, last, at = self.tag(view, at)
        if kind == OPAQUE:
            self._object(view, bytes(view[first:last]), at, depth)
            return
        shape = struct.unpack_from(f"{self.order}{(last - first) // 4}i", view, first)
        if len(shape) < 2 or min(shape) < 0:
            raise self.fault(f"an array of shape {shape[:8]}")
        _, first, last, at = self.tag(view, at)
        if not depth and first == last:
            self.is_plain = False  # what objects refer to has no name
        if kind in (CELL, STRUCT, OBJECT):
            members = prod(shape)
            if kind != CELL:
                width, at = self._fields(view, at, kind)
                members *= width
                if not width and prod(shape) > 1:
                    raise self.fault("many structures without a field")
            if members * 8 > len(view) - at:
                raise self.fault(f"{members} arrays in {len(view) - at} bytes")
        while at < len(view):
            at = self.element(view, at, depth + 1)

    def _object(self, view: memoryview, name: bytes, at: int, depth: int) -> None:
        """Note an object of a class: its name, the word MCOS, its class and what it refers to."""
        _, _, _, at = self.tag(view, at)
        _, first, last, at = self.tag(view, at)
        self.is_plain = False
        if not depth:
            self.objects[name.decode("ascii", "replace")] = bytes(view[first:last]).decode(
                "ascii", "replace"
            )
        while at < len(view):
            at = self.element(view, at, depth + 1)

    def _fields(self, view: memoryview, at: int, kind: int) -> tuple[int, int]:
        """Count of the fields of a structure, and where its members begin."""
        if kind == OBJECT:
            _, _, _, at = self.tag(view, at)
        _, first, _, at = self.tag(view, at)
        length = struct.unpack_from(f"{self.order}i", view, first)[0]
        _, first, last, at = self.tag(view, at)
        if length < 1:
            raise self.fault(f"names of {length} letters")
        return (last - first) // length, at
