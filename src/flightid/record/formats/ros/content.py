"""What a bag holds, gathered message by message within the memory budget."""

from __future__ import annotations

import bz2
import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import field
from sys import getsizeof
from typing import IO, cast

from flightid.errors import FileFormatError
from flightid.extras import extra_module
from flightid.frozen import dataclass
from flightid.reading import require_memory

LONGEST = 1 << 16
"""Bytes of a message beyond which it is a picture or a cloud, not samples."""
OVERHEAD = 150
"""Bytes that the interpreter takes for a message beside its own."""
PIECE = 1 << 20


@dataclass(eq=False)
class Topic:
    """A topic with its messages, not decoded.

    Attributes
    ----------
    name, type : str
        Such as "/imu" and "sensor_msgs/Imu".
    definition : str
        Text of the message definition; empty where the bag holds none.
    encoding : str
        "cdr" or "ros1"; others are not decoded.
    received_ns : list of int
        Stamps of the recorder.
    payloads : list of bytes
    is_long : bool
        Its messages are too long for samples and were left out.
    """

    name: str
    type: str
    definition: str
    encoding: str
    received_ns: list[int] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)
    is_long: bool = False


@dataclass(eq=False)
class BagContent:
    """Topics by what their container calls them; `cut` says where a file ended too early."""

    name: str
    topics: dict[object, Topic] = field(default_factory=dict)
    cut: str = ""
    n_bytes: int = 0

    def add(self, key: object, received_ns: int, payload: bytes) -> None:
        """Keep a message of a topic.

        Raises
        ------
        FileFormatError
            The topic was not declared, the stamp is none, or the messages are more than the memory
            budget.
        """
        topic = self.topics.get(key)
        if topic is None:
            raise FileFormatError(
                f"{self.name} holds a message of no topic",
                found=repr(key)[:40],
                needed="a channel for each",
            )
        if not 0 <= received_ns < 1 << 63:
            raise FileFormatError(
                f"{self.name} holds a stamp that is none",
                found=f"{received_ns} ns"[:60],
                needed="ns since 1970, below 2^63",
                action="record it again, or correct the clock of the recorder",
            )
        if topic.is_long:
            return
        if len(payload) > LONGEST:
            self.n_bytes -= sum(map(len, topic.payloads)) + OVERHEAD * len(topic.payloads)
            topic.is_long = True
            topic.received_ns.clear()
            topic.payloads.clear()
            return
        self.hold(len(payload) + OVERHEAD)
        topic.received_ns.append(received_ns)
        topic.payloads.append(payload)

    def declare(self, key: object, topic: Topic) -> None:
        """Keep a topic that messages may be of; the first of a key counts.

        Raises
        ------
        FileFormatError
            What is held is more than the memory budget.
        """
        if key not in self.topics:
            self.hold(4 * OVERHEAD + sum(map(getsizeof, (topic.name, topic.type))))
            self.topics[key] = topic

    def hold(self, n_bytes: float) -> None:
        """Count what is kept in memory.

        Raises
        ------
        FileFormatError
            All that is held is more than the memory budget.
        """
        self.require(n_bytes)
        self.n_bytes += int(n_bytes)

    def require(self, n_bytes: float) -> None:
        """Ask for memory beside what is held, for a while.

        Raises
        ------
        FileFormatError
            Both are more than the memory budget.
        """
        require_memory(self.name, self.n_bytes + n_bytes)

    @contextmanager
    def inflated(self, kind: str, data: bytes, size: int) -> Iterator[bytes]:
        """Content of a chunk, held as long as it is walked through; as `inflated`.

        Raises
        ------
        FlightidError
            As `inflated`; all that is held is more than the memory budget.
        """
        self.require(len(data) + 2 * size)
        content = inflated(self.name, kind, data, size)
        self.hold(size)
        yield content
        self.n_bytes -= size


def inflated(name: str, kind: str, data: bytes, size: int) -> bytes:
    """Content of a compressed chunk, of the size that it declares.

    Parameters
    ----------
    name : str
        Of the file.
    kind : str
        "" or "none", "bz2", "lz4", "zstd".
    data : bytes
    size : int
        Bytes that it declares.

    Raises
    ------
    FileFormatError
        It is of another size, or packed in a way that is not read.
    OptionError
        The library that unpacks it is not installed.
    """
    if kind in ("", "none"):
        stream: IO[bytes] = io.BytesIO(data)
    elif kind == "bz2":
        stream = cast(IO[bytes], bz2.BZ2File(io.BytesIO(data)))
    elif kind == "lz4":
        stream = extra_module("lz4.frame", "a bag packed with lz4").open(io.BytesIO(data))
    elif kind == "zstd":
        library = extra_module("zstandard", "a bag packed with zstd")
        stream = library.ZstdDecompressor(max_window_size=1 << 27).stream_reader(data)
    else:
        raise FileFormatError(
            f"{name} is packed in a way that is not read",
            found=kind[:20],
            needed="bz2, lz4 or zstd",
        )
    content = b"".join(_pieces(stream, size + 1))
    if len(content) != size:
        raise FileFormatError(
            f"a chunk of {name} is not as long as it says",
            found=f"{len(content)} bytes",
            needed=f"{size}",
            action="copy the bag again",
        )
    return content


def _pieces(stream: IO[bytes], most: int) -> Iterator[bytes]:
    """Content in pieces: memory grows with what is there, not with what is declared."""
    while most > 0 and (piece := stream.read(min(PIECE, most))):
        most -= len(piece)
        yield piece
