"""The study of a pilot's flight as text: ``[pilot]``, written beside its record and read again."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomlkit

from flightid.app.fly_journal import STUDY
from flightid.app.fly_schemas import FlyStart
from flightid.app.fly_vehicles import FlyVehicle
from flightid.app.own_folders import read_plain
from flightid.errors import OptionError
from flightid.files import write_atomically
from flightid.reading import DOCUMENT_BYTES
from flightid.study.pilot_settings import PilotSettings, RatingSettings, pilot_of, pilot_table

HEAD = (
    "# A flight of the local page: `flightid fly` of this file has its vehicle, air and delays in\n"
    "# hand again. Stick, sweeps and switches, as they were flown, are in its record alone.\n"
)


def write_flight_study(folder: Path, asked: FlyStart, vehicle: FlyVehicle) -> None:
    """Write the study of a flight into its folder; a model file is named from there."""
    name = os.path.relpath(vehicle.path, folder) if vehicle.path else vehicle.name
    fields = asked.model_dump(exclude={"do", "law"})
    fields |= {"vehicle": Path(name).as_posix(), "augmentation": asked.law}
    told = PilotSettings(**fields)
    document = {"study": {"title": vehicle.title}, "pilot": pilot_table(told)}
    write_atomically(folder / STUDY, HEAD + tomlkit.dumps(document))


def rate_flight_study(folder: Path, rating: Mapping[str, Any]) -> None:
    """Put a rating into the study of a flight; one of before this there was is left alone."""
    try:
        document = tomlkit.parse(read_plain(folder / STUDY, DOCUMENT_BYTES).decode())
    except (OSError, ValueError):
        return
    told = vars(RatingSettings(**rating))
    table: Any = document["pilot"]
    table["rating"] = {key: value for key, value in told.items() if value not in (None, "")}
    write_atomically(folder / STUDY, tomlkit.dumps(document))


def start_of(text: str, folder: Path, known: Sequence[FlyVehicle]) -> FlyStart:
    """What a study says, as the page begins a flight.

    Parameters
    ----------
    text : str
        Of the study.
    folder : Path
        In which it lies, or would lie: a model file is named from there.
    known : sequence of FlyVehicle
        That the page offers.

    Raises
    ------
    StudyError
        It is no study, or says no flight.
    OptionError
        The page offers no such vehicle.
    """
    with tempfile.TemporaryDirectory() as name:
        told = pilot_of(write_atomically(Path(name) / STUDY, text))
    if told is None:
        raise OptionError("this study says no flight", needed="a table [pilot]")
    place = Path(os.path.normpath(folder / told.vehicle))
    for each in known:
        if each.name == told.vehicle or (each.path and Path(each.path) == place):
            fields = {k: v for k, v in vars(told).items() if k in FlyStart.model_fields}
            return FlyStart(**{**fields, "vehicle": each.name, "law": told.augmentation})
    raise OptionError(
        "this page offers no such vehicle",
        found=told.vehicle,
        needed=", ".join(each.name for each in known),
        action="put its model file under models/ of the folder",
    )
