"""Text logs of ArduPilot, printed from binary ones (native half: `dataflash/printed.rs`)."""

from __future__ import annotations

from pathlib import Path

from flightid import _native
from flightid.errors import LogFormatError
from flightid.logs.dataflash.reader import DataflashSource
from flightid.reading import bounded_bytes

LARGEST = 1 << 29
"""Bytes of a file that are read."""


def open_printed(path: Path) -> DataflashSource:
    """Read a text log of ArduPilot (``.log``), by way of the binary form it was printed from.

    Flight modes that are printed by name have no number then.

    Raises
    ------
    LogFormatError
        The file holds no message, or is larger than is read.
    OSError
        The file cannot be read.
    """
    text = bounded_bytes(path, LARGEST, LogFormatError)
    made, bad_lines = _native.dataflash_of_text(text)
    return DataflashSource(_native.index_dataflash(made), bad_lines)
