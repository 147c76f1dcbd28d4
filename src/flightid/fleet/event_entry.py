"""An event written down in a fleet file: one more ``[[event]]``, all that stood there kept."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path

from flightid.errors import StudyError
from flightid.files import write_atomically
from flightid.fleet.settings import EventSettings, FleetSettings, read_fleet


def add_event(path: Path, event: EventSettings) -> FleetSettings:
    """Add an event at the end of a fleet file; comments and order of the others stay.

    Parameters
    ----------
    path : Path
        Fleet file.
    event : EventSettings

    Returns
    -------
    FleetSettings
        As they read with the event.

    Raises
    ------
    StudyError
        The file is none, the date has no meaning, the event stands there already, or the file
        writes its events in a form to which none can be added at its end.

    Example
    -------
    >>> event = EventSettings("2026-03-01", "new propellers", "V00")
    >>> [each.what for each in add_event(Path("fleet.toml"), event).events]
    ['new propellers']
    """
    settings = read_fleet(path)
    if event in settings.events:
        raise StudyError("this event stands in the fleet file already", found=event.what)
    text = path.read_text("utf-8")
    written = "\n".join(("", "[[event]]", *_lines(event), ""))
    content = f"{text}{'' if text.endswith(chr(10)) or not text else chr(10)}{written}"
    # What a reader makes of it is seen before the file itself is another.
    with tempfile.NamedTemporaryFile(
        "w", encoding="utf-8", dir=path.parent, prefix=".", suffix=path.suffix
    ) as tried:
        tried.write(content)
        tried.flush()
        read = read_fleet(tried.name)
    if read.events != (*settings.events, event):
        raise StudyError("the event would not read as it is meant", found=event.what)
    write_atomically(path, content)
    return replace(read, path=path)


def _lines(event: EventSettings) -> list[str]:
    told = {"date": event.date, "vehicle": event.vehicle, "what": event.what}
    return [f"{key} = {_text(value)}" for key, value in told.items() if value is not None]


def _text(value: str) -> str:
    """A basic string of TOML: JSON's, but for one letter that TOML wants escaped too."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
