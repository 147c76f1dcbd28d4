"""Bags of ROS 1: records of a header of ``name=value`` fields, and data; chunks hold further ones.

Reference: "Bags/Format/2.0", wiki.ros.org.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path
from sys import getsizeof
from typing import BinaryIO

from flightid.record.formats.ros.content import BagContent, Topic
from flightid.record.formats.sniff import ROSBAG

MESSAGE, CHUNK, CONNECTION = 2, 5, 7
MOST_FIELDS = 100


def gather(path: Path, content: BagContent) -> None:
    """Add the messages of a file to the content of a bag.

    Raises
    ------
    FileFormatError
        A record is not one, or more than the memory budget.
    """
    with path.open("rb") as stream:
        stream.seek(len(ROSBAG))
        _walk(stream, path, content, path.stat().st_size)


def _walk(
    stream: BinaryIO, path: Path, content: BagContent, end: int, *, is_chunk: bool = False
) -> None:
    while len(size := stream.read(4)) == 4:
        header = _fields(_block(stream, size, end, content))
        size = stream.read(4)
        kind = header["op"][0]
        if kind not in (MESSAGE, CHUNK, CONNECTION) or (kind == CHUNK and is_chunk):
            stream.seek(int.from_bytes(size, "little"), 1)
            continue
        if len(size) < 4 or int.from_bytes(size, "little") > end - stream.tell():
            break
        data = _block(stream, size, end, content)
        if kind == CHUNK:
            unpacked = int.from_bytes(header["size"], "little")
            packing = header["compression"].decode("ascii")
            with content.inflated(packing, data, unpacked) as inner:
                _walk(io.BytesIO(inner), path, content, len(inner), is_chunk=True)
        elif kind == CONNECTION:
            said = _fields(data)
            said_type, definition, name = (
                value.decode("utf-8", "replace")
                for value in (said["type"], said["message_definition"], header["topic"])
            )
            content.hold(getsizeof(definition))
            content.declare((path, header["conn"]), Topic(name, said_type, definition, "ros1"))
        else:
            seconds, rest = struct.unpack("<II", header["time"])
            content.add((path, header["conn"]), seconds * 1_000_000_000 + rest, data)
    else:
        return
    content.cut = path.name


def _block(stream: BinaryIO, size: bytes, end: int, content: BagContent) -> bytes:
    count = int.from_bytes(size, "little")
    content.require(count)
    return stream.read(min(count, max(0, end - stream.tell())))


def _fields(header: bytes) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    at = 0
    while at < len(header):
        if len(found) > MOST_FIELDS:
            raise ValueError(f"a header of more than {MOST_FIELDS} fields")
        (size,) = struct.unpack_from("<I", header, at)
        name, _, value = header[at + 4 : at + 4 + size].partition(b"=")
        found[name.decode("ascii", "replace")] = value
        at += 4 + size
    return found
