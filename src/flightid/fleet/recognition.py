"""Whether a path is a fleet, told without what fleets need."""

from __future__ import annotations

from pathlib import Path

from flightid.errors import FlightidError
from flightid.reading import read_toml

CURRENT = "fleet.json"
"""Names the newest recipe of a catalogue, in its outer folder."""


def is_fleet(path: Path) -> bool:
    """Whether a path is a fleet file or the folder of a catalogue."""
    if path.is_dir():
        return (path / CURRENT).is_file()
    try:
        return path.suffix == ".toml" and "fleet" in read_toml(path, "the file")
    except FlightidError:
        return False
