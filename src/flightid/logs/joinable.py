"""Files that join others by their clocks: of a flight log its record, of all else the file."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
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
            beside = [each.name for each in path.parent.glob("*")]
            near = get_close_matches(path.name, beside, 1)
            raise OptionError(
                "a file that is to join is not there",
                found=f"join={str(path)!r}",
                needed="a table, a bag or a flight log",
                action=f"{near[0]} is there: join it" if near else "check name and folder",
            )
    return [read_log(path).record() if is_log(path) else path for path in paths]
