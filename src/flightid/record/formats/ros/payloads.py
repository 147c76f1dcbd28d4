"""Payloads of a topic to numbers, by the layout of its type.

CDR aligns numbers to their size, counted from behind its four bytes of header (OMG DDSI-RTPS 2.5,
section 10; DDS-XTypes 1.3, section 7.4.1); ROS 1 packs them without gaps, little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FileFormatError
from flightid.reading import decoding
from flightid.record.formats.ros.content import BagContent, Topic
from flightid.record.formats.ros.layouts import MOST_ELEMENTS, FieldLayout, NumberRun, Repeat

CDR_HEADER = 4
PLAIN_CDR = {b"\x00\x00": ">", b"\x00\x01": "<"}


def decoded(
    topic: Topic, layout: FieldLayout, content: BagContent
) -> tuple[list[str], NDArray[np.float64]]:
    """Numbers of all messages of a topic.

    An array as long as a message says has as many columns as in the first message; where a later
    one is shorter the rest is missing (NaN).

    Parameters
    ----------
    topic : Topic
        With at least one message.
    layout : FieldLayout
    content : BagContent
        Counts the numbers beside what it holds.

    Returns
    -------
    columns : list of str
        "" where a number is no column.
    values : ndarray, shape (n_messages, n_columns)

    Raises
    ------
    FileFormatError
        A message is not of its type, or of an encoding that is not read; all numbers that were
        asked for are more than the memory budget.
    """
    with decoding(f"{content.name}, topic {topic.name}", f"messages of type {topic.type}"):
        first = _Message(topic.payloads[0], topic.encoding)
        first.walk(layout.steps)
        content.hold(8.0 * len(first.columns) * len(topic.payloads))
        values = np.empty((len(topic.payloads), len(first.columns)))
        for row, payload in zip(values, topic.payloads, strict=True):
            message = _Message(payload, topic.encoding, first.sizes)
            message.walk(layout.steps)
            row[:] = message.numbers
    return first.columns, values


def leading_columns(topic: Topic, layout: FieldLayout, name: str) -> list[str]:
    """Columns of a topic, as its first message has them; "" where a number is none.

    Raises
    ------
    FileFormatError
        The message is not of its type, or of an encoding that is not read.
    """
    with decoding(f"{name}, topic {topic.name}", f"messages of type {topic.type}"):
        first = _Message(topic.payloads[0], topic.encoding)
        first.walk(layout.steps)
    return first.columns


class _Message:
    """A walk through the bytes of a message.

    Parameters
    ----------
    payload : bytes
    encoding : str
        "cdr" or "ros1".
    sizes : sequence of int, optional
        Columns of each array that is as long as a message says; without them this is the first
        message, which decides.
    """

    def __init__(self, payload: bytes, encoding: str, sizes: Sequence[int] | None = None) -> None:
        self.is_cdr, self.order, self.at = encoding == "cdr", "<", 0
        if self.is_cdr:
            found = PLAIN_CDR.get(payload[:2])
            if found is None:
                raise FileFormatError(
                    "a message is in no encoding that is read",
                    found=payload[:CDR_HEADER].hex(" "),
                    needed="plain CDR, 00 00 or 00 01",
                )
            self.order, payload = found, payload[CDR_HEADER:]
        self.payload = payload
        self.expected = None if sizes is None else iter(sizes)
        self.sizes: list[int] = []
        self.columns: list[str] = []
        self.numbers: list[float] = []

    def walk(self, steps: Sequence[NumberRun | Repeat]) -> None:
        """Take the numbers of some steps."""
        for step in steps:
            if isinstance(step, Repeat):
                self.repeat(step)
                continue
            reader = _reader(step.letters, self.order, self.at % 8 if self.is_cdr else -1)
            self.numbers += reader.unpack_from(self.payload, self.at)
            self.at += reader.size
            if self.expected is None:
                self.columns += step.columns

    def repeat(self, step: Repeat) -> None:
        """Take or pass over several of one thing."""
        count = self.length() if step.count is None else step.count
        if step.letter:
            self.array(step, count)
        elif step.text_width:
            for _ in range(count):
                self.skip(self.length() * step.text_width)
        else:
            kept, columns = len(self.numbers), len(self.columns)
            for _ in range(count):
                self.walk(step.steps)
                del self.numbers[kept:], self.columns[columns:]

    def array(self, step: Repeat, count: int) -> None:
        """Numbers of one kind; the first of them become columns."""
        width = struct.calcsize("<" + step.letter)
        if self.is_cdr and count:
            self.at += -self.at % width
        start = self.at
        self.skip(count * width)
        if not step.column:
            return
        if self.expected is None:
            kept = min(count, MOST_ELEMENTS)
            self.columns += [f"{step.column}[{index}]" for index in range(kept)]
            self.sizes.append(kept)
        else:
            kept = next(self.expected)
        some = min(count, kept)
        self.numbers += struct.unpack_from(f"{self.order}{some}{step.letter}", self.payload, start)
        self.numbers += [np.nan] * (kept - some)

    def length(self) -> int:
        """How many follow: no more than there are bytes."""
        reader = _reader("I", self.order, self.at % 8 if self.is_cdr else -1)
        (count,) = reader.unpack_from(self.payload, self.at)
        self.at += reader.size
        if count > len(self.payload) - self.at:
            raise ValueError(f"{count} elements in {len(self.payload) - self.at} bytes")
        return int(count)

    def skip(self, n_bytes: int) -> None:
        """Pass over bytes that have to be there."""
        self.at += n_bytes
        if self.at > len(self.payload):
            raise ValueError(f"it ends {self.at - len(self.payload)} bytes too early")


@lru_cache(maxsize=1024)
def _reader(letters: str, order: str, phase: int) -> struct.Struct:
    """Reader of a run that begins at this place of eight; -1: without gaps."""
    if phase < 0:
        return struct.Struct(order + letters)
    form, at = order, phase
    for letter in letters:
        width = struct.calcsize("<" + letter)
        gap = -at % width
        form += f"{gap}x{letter}" if gap else letter
        at += gap + width
    return struct.Struct(form)
