"""What a flight leaves in the workspace: a journal while it is flown, then a record, and a rating.

``flights/<id>/``: ``study.toml`` what flies it again, ``flight.json`` what was flown,
``journal.csv`` rows of the loop written each second, in its place at the end ``flown.nc``;
``rating.json`` what the pilot thought of it. A server that was killed leaves a journal; it becomes
a record when somebody asks for it, less the row that was half written.
"""

from __future__ import annotations

import json
import re
import secrets
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flightid.app.fly_vehicles import fly_vehicle
from flightid.app.own_folders import is_link, own_folder, read_plain
from flightid.errors import DataError, FlightidError, OptionError
from flightid.files import write_atomically
from flightid.frozen import dataclass
from flightid.record import Record, Step, write_records

FLIGHTS, RECORD, JOURNAL, ABOUT, RATING, STUDY = (
    "flights", "flown.nc", "journal.csv", "flight.json", "rating.json", "study.toml",
)  # fmt: skip
FLIGHT_ID = re.compile(r"[0-9]{8}-[0-9]{6}-[0-9a-f]{4}")
FEWEST_ROWS, MOST_ABOUT = 10, 1 << 20
MOST_TITLE = 200
EVERY_S = 1.0
KINDS = ("input", "output", "excitation", "other")


def flight_folder(workspace: Path, flight: str) -> Path:
    """Folder of a flight; made where it is missing, no link is followed.

    Raises
    ------
    OptionError
        That is no name of a flight, or a link stands in its place.
    """
    if not FLIGHT_ID.fullmatch(flight):
        raise OptionError("this is no flight of the workspace", found=flight)
    return own_folder(workspace, FLIGHTS, flight)


def new_flight_id() -> str:
    """By the clock, so that the list is in the order of flying."""
    return f"{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(2)}"


@dataclass(frozen=True)
class FlightColumn:
    """A channel of the journal."""

    name: str
    kind: str
    unit: str


class FlightJournal:
    """Rows of a flight, in a file that a kill shortens by a second at most.

    Parameters
    ----------
    folder : Path
        Of the flight.
    columns : sequence of FlightColumn
    about : mapping of str to object
        What is flown, in plain values.
    sample_time_s : float
        Of a row, s.
    """

    def __init__(
        self, folder: Path, columns: Sequence[FlightColumn], about: Mapping[str, Any], *,
        sample_time_s: float,
    ) -> None:  # fmt: skip
        self.folder = folder
        told = {
            **about,
            "sample_time_s": sample_time_s,
            "columns": [[each.name, each.kind, each.unit] for each in columns],
        }
        write_atomically(folder / ABOUT, json.dumps(told, allow_nan=False))
        self._every = max(1, round(EVERY_S / sample_time_s))
        self._rows: list[str] = []
        self._stream = (folder / JOURNAL).open("x", encoding="ascii")

    def add(self, values: Sequence[float]) -> None:
        """Append a row."""
        self._rows.append(",".join(map(repr, values)) + "\n")
        if len(self._rows) >= self._every:
            self.flush()

    def flush(self) -> None:
        """Hand what is kept to the system."""
        self._stream.write("".join(self._rows))
        self._stream.flush()
        self._rows = []

    def close(self) -> None:
        """Write the rest."""
        self.flush()
        self._stream.close()


def about_flight(folder: Path) -> dict[str, Any]:
    """What was flown.

    Raises
    ------
    DataError
        The file is not what was written.
    """
    try:
        found = json.loads(read_plain(folder / ABOUT, MOST_ABOUT))
        columns = [FlightColumn(*each) for each in found["columns"]]
        step = float(found["sample_time_s"])
        sound = all(each.kind in KINDS for each in columns) and 1e-4 < step < 1.0
        name = str(found["vehicle"])
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise DataError("what is told of a flight cannot be read", found=folder.name) from error
    if not sound:
        raise DataError("what is told of a flight has no meaning", found=folder.name)
    return {**found, "columns": columns, "sample_time_s": step, "vehicle": name}


def journal_record(folder: Path) -> Record:
    """The record of a journal, whole rows alone.

    Raises
    ------
    DataError
        Fewer rows than a record needs, or a row that is none of this flight.
    """
    about = about_flight(folder)
    columns: list[FlightColumn] = about["columns"]
    lines = read_plain(folder / JOURNAL).decode("ascii", "replace").split("\n")[:-1]
    try:
        rows = np.array([[float(each) for each in line.split(",")] for line in lines])
    except ValueError as error:
        raise DataError("a journal holds what is no number", found=folder.name) from error
    if len(rows) < FEWEST_ROWS or rows.shape[1:] != (len(columns),):
        raise DataError(
            "a journal holds too little to be a record",
            found=f"{len(rows)} rows", needed=f"{FEWEST_ROWS} or more",
        )  # fmt: skip
    parts: dict[str, dict[str, Any]] = {kind: {} for kind in KINDS}
    for column, values in zip(columns, rows.T, strict=True):
        if column.kind != "excitation" or np.any(values):
            parts[column.kind][column.name] = values
    kept = [name for part in parts.values() for name in part]
    told = {name: value for name, value in about.items() if name != "columns"}
    return Record.from_arrays(
        np.arange(len(rows)) * about["sample_time_s"],
        inputs=parts["input"], outputs=parts["output"], excitations=parts["excitation"],
        others=parts["other"], name="flown", hold="zero",
        units={each.name: each.unit for each in columns if each.name in kept},
        history=[Step("flown on the local page", told)],
    )  # fmt: skip


def finish_flight(folder: Path) -> Record:
    """Make the record of a flight; its journal goes when the record is there.

    Raises
    ------
    DataError
        As `journal_record`.
    """
    made = journal_record(folder)
    told = json.loads(read_plain(folder / ABOUT, MOST_ABOUT))
    told["swept_s"] = _swept_s(made, told.get("moved"))
    write_atomically(folder / ABOUT, json.dumps(told, allow_nan=False))
    target = folder / RECORD
    if is_link(target):
        target.unlink()
    write_records(made, target)
    (folder / JOURNAL).unlink(missing_ok=True)
    return made


def _swept_s(flown: Record, moved: object) -> dict[str, float]:
    """How long each input that a hand moves was swept, s."""
    known = [name for name in flown.inputs if not isinstance(moved, list) or name in moved]
    step_s = 1.0 / flown.sample_rate_hz
    return {
        name: float(np.count_nonzero(flown[f"sweep_{name}"]) * step_s)
        if f"sweep_{name}" in flown else 0.0
        for name in known
    }  # fmt: skip


def drop_flight(folder: Path) -> None:
    """Remove a flight that holds nothing: its own files alone."""
    for name in (JOURNAL, ABOUT, STUDY):
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()


def kept_flights(workspace: Path) -> list[dict[str, Any]]:
    """What the workspace holds of flights, newest first; broken ones are left out."""
    found = []
    for entry in sorted(own_folder(workspace, FLIGHTS).iterdir(), reverse=True):
        if not FLIGHT_ID.fullmatch(entry.name) or is_link(entry) or not entry.is_dir():
            continue
        try:
            about = about_flight(entry)
            title = about.get("title") or fly_vehicle(about["vehicle"]).title
        except FlightidError:
            continue
        done = (entry / RECORD).is_file()
        if not done and not (entry / JOURNAL).is_file():
            continue
        found.append({
            "id": entry.name, "vehicle": about["vehicle"], "title": str(title)[:MOST_TITLE],
            "finished": done,
            "law": bool(about.get("law", False)), "rating": kept_rating(entry),
            "path": f"{FLIGHTS}/{entry.name}/{RECORD if done else JOURNAL}",
            "swept_s": about.get("swept_s") if done else None,
        })  # fmt: skip
    return found


def kept_rating(folder: Path) -> dict[str, Any] | None:
    """The pilot's rating of a flight; None where there is none, or it is broken."""
    try:
        found = json.loads(read_plain(folder / RATING, 1 << 16))
    except (OSError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def keep_rating(folder: Path, rating: Mapping[str, Any]) -> None:
    """Write a rating beside its flight."""
    write_atomically(folder / RATING, json.dumps(rating, allow_nan=False, ensure_ascii=False))
