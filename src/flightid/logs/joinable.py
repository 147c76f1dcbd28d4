"""Files that join others by their clocks: of a flight log its record, of all else the file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from flightid.logs.reader import is_log, read_log
from flightid.record import Record


def joinable(files: Iterable[str | Path]) -> list[Path | Record]:
    """What `flightid.read_records` takes for files that are to join a table.

    Raises
    ------
    FlightidError
        A log cannot be read as a record.
    OSError
        A file is not there.
    """
    return [read_log(file).record() if is_log(file) else Path(file) for file in files]
