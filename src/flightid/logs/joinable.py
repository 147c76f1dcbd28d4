"""Files that join others by their clocks: of a flight log its record, of all else the file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from flightid.errors import OptionError
from flightid.logs.reader import is_log, read_log
from flightid.record import Record


def joinable(files: Iterable[str | Path]) -> list[Path | Record]:
    """What `flightid.read_records` takes for files that are to join a table.

    Raises
    ------
    OptionError
        A file is not there.
    FlightidError
        A log cannot be read as a record.
    """
    paths = list(map(Path, files))
    for path in paths:
        if not path.exists():
            raise OptionError(
                "a file that is to join is not there",
                found=f"join={str(path)!r}",
                needed="a table, a bag or a flight log",
            )
    return [read_log(path).record() if is_log(path) else path for path in paths]
