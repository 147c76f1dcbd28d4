"""MCAP: records of an opcode and a length; chunks hold further records.

Reference: the MCAP format specification, mcap.dev/spec.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path
from sys import getsizeof
from typing import BinaryIO
from zlib import crc32

from flightid.errors import FileFormatError
from flightid.record.formats.ros.content import OVERHEAD, BagContent, Topic
from flightid.record.formats.ros.definitions import short_name
from flightid.record.formats.sniff import MCAP

SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 3, 4, 5, 6, 15
ENCODINGS = {"ros2msg", "ros1msg"}


def gather(path: Path, content: BagContent) -> None:
    """Add the messages of a file to the content of a bag.

    Raises
    ------
    FileFormatError
        A record is not one, or more than the memory budget.
    """
    with path.open("rb") as stream:
        stream.seek(len(MCAP))
        _walk(stream, path, content, {}, path.stat().st_size)


def _walk(
    stream: BinaryIO,
    path: Path,
    content: BagContent,
    schemas: dict[int, tuple[str, str]],
    end: int,
    *,
    is_chunk: bool = False,
) -> None:
    """Records up to the end of the data; a file that ends within one was cut."""
    while head := stream.read(9):
        kind, size = struct.unpack("<BQ", head.ljust(9, b"\xff"))
        if kind == DATA_END:
            return
        if size > end - stream.tell():
            content.cut = path.name
            return
        if kind not in (SCHEMA, CHANNEL, MESSAGE, CHUNK) or (kind == CHUNK and is_chunk):
            stream.seek(size, 1)
            continue
        content.require(2 * size)
        body = stream.read(size)
        if kind == SCHEMA:
            number, (name, encoding, text) = _leading(body, 2, 3)
            if number not in schemas:
                content.hold(OVERHEAD + getsizeof(name) + getsizeof(text))
                schemas[number] = short_name(name), text if encoding in ENCODINGS else ""
        elif kind == CHANNEL:
            number, (topic, encoding) = _leading(body, 4, 2)
            known = schemas.get(number >> 16, ("", ""))
            made = Topic(topic, known[0], known[1], encoding)
            content.declare((path, number & 0xFFFF), made)
        elif kind == MESSAGE:
            channel, _, logged_ns, _ = struct.unpack_from("<HIQQ", body)
            content.add((path, channel), logged_ns, body[22:])
        else:
            _, _, unpacked, declared = struct.unpack_from("<QQQI", body)
            packing, at = _text(body, 28)
            with content.inflated(packing, body[at + 8 :], unpacked) as inner:
                _require_sum(path.name, declared, crc32(inner))
                _walk(io.BytesIO(inner), path, content, schemas, len(inner), is_chunk=True)
    if not is_chunk:
        content.cut = path.name


def _require_sum(name: str, declared: int, found: int) -> None:
    """A chunk whose bytes are not those that were recorded is refused; 0 says nothing of them."""
    if declared not in (0, found):
        raise FileFormatError(
            f"a chunk of {name} is damaged",
            found=f"checksum {found:08x}",
            needed=f"{declared:08x}, as the chunk says",
            action="copy the bag again; `mcap recover` keeps its whole chunks",
        )


def _leading(body: bytes, width: int, count: int) -> tuple[int, list[str]]:
    """A number, then texts."""
    texts, at = [], width
    for _ in range(count):
        text, at = _text(body, at)
        texts.append(text)
    return int.from_bytes(body[:width], "little"), texts


def _text(body: bytes, at: int) -> tuple[str, int]:
    (size,) = struct.unpack_from("<I", body, at)
    return body[at + 4 : at + 4 + size].decode("utf-8", "replace"), at + 4 + size
