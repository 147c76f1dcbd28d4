"""Text logs of ArduPilot, printed from binary ones (native half: `dataflash/printed.rs`)."""

from __future__ import annotations

from pathlib import Path

from flightid import _native
from flightid.errors import LogFormatError
from flightid.logs.dataflash.reader import DataflashSource
from flightid.reading import bounded_bytes, memory_budget, within_memory


def open_printed(path: Path) -> DataflashSource:
    """Read a text log of ArduPilot (``.log``), by way of the binary form it was printed from.

    Flight modes that are printed by name have no number then.

    Raises
    ------
    LogFormatError
        The file holds no message, or is larger than the memory budget.
    FileFormatError
        What it holds takes more than that.
    OSError
        The file cannot be read.
    """
    text = bounded_bytes(path, memory_budget(), LogFormatError)
    with within_memory(path.name):
        made, bad_lines = _native.dataflash_of_text(text, memory_budget())
    return DataflashSource(_native.index_dataflash(made), bad_lines)
