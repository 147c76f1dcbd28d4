"""Opening a catalogue by its place, or by the fleet file that it belongs to."""

from __future__ import annotations

import json
import re
from pathlib import Path

from flightid.conventions import Light
from flightid.errors import DataError, FlightidError
from flightid.findings import Finding
from flightid.fleet.catalogue.catalogue import Catalogue
from flightid.fleet.catalogue.parts import BROKEN_JSON
from flightid.fleet.catalogue.store import Store, store_at
from flightid.fleet.engine.order import recipe
from flightid.fleet.recognition import CURRENT
from flightid.fleet.settings import FleetSettings, read_fleet
from flightid.reading import DOCUMENT_BYTES

RECIPE = re.compile("[0-9a-f]{12}")
FLEET_SCHEMA = "flightid.fleet_place/1"


def open_catalogue(place: str | Path, *, earlier: bool = False) -> Catalogue:
    """Open the catalogue of a fleet for questions.

    Parameters
    ----------
    place : str or Path
        Folder or address of the catalogue, or the fleet file (``*.toml``).
    earlier : bool
        Whether records of earlier studies and versions count for logs of which there is no newer
        one: a fleet that is being taken again is whole meanwhile. The column ``recipe`` of the
        table ``logs`` tells them apart.

    Returns
    -------
    Catalogue
        Relations of DuckDB and frames of pandas; nothing in it can be changed.

    Raises
    ------
    DataError
        There is no catalogue.
    OptionError
        The extra ``fleet`` is not installed.

    Example
    -------
    >>> import flightid as fid
    >>> with fid.fleet.open("fleet.toml") as catalogue:
    ...     catalogue.query("select vehicle, count(*) from logs group by 1 order by 1").fetchall()
    [('v00', 8), ('v01', 8), ('v02', 8), ('v03', 8), ('v04', 8), (None, 3)]
    """
    outer = catalogue_place(place).rstrip("/")
    store = opened_store(outer)
    if not earlier:
        return Catalogue(store)
    present = store.root.rpartition("/")[2]
    others = (name for name in sorted(store_at(outer).folders("")) if RECIPE.fullmatch(name))
    return Catalogue(store, [store_at(f"{outer}/{each}") for each in others if each != present])


def catalogue_place(place: str | Path) -> str:
    """Folder or address of a catalogue, which a fleet file names."""
    return read_fleet(place).catalogue if names_fleet_file(place) else str(place)


def names_fleet_file(place: str | Path) -> bool:
    """Whether a place is a fleet file; a folder may end in .toml too.

    Example
    -------
    >>> names_fleet_file("fleet.toml"), names_fleet_file("fleet-catalogue")
    (True, False)
    """
    return str(place).endswith(".toml") and not Path(place).is_dir()


def current_store(settings: FleetSettings) -> Store:
    """The store of a fleet's records for its present study, noted as the one to be opened."""
    own = recipe(settings)
    outer = store_at(settings.catalogue)
    note = {"schema": FLEET_SCHEMA, "current": own, "title": settings.words.title}
    content = json.dumps(note, indent=1).encode()
    if not (outer.exists(CURRENT) and outer.read(CURRENT) == content):
        outer.write(CURRENT, content)
    place = f"{settings.catalogue.rstrip('/')}/{own}"
    if Path(place).is_symlink():
        raise DataError(
            "the folder of a catalogue is a link: nothing is written through it",
            found=place,
            action="remove the link, or name what it leads to as the catalogue",
        )
    return store_at(place)


def earlier_light(settings: FleetSettings, store: Store) -> tuple[Finding, ...]:
    """That the records are of before the study, version or rules for vehicles were changed."""
    try:
        is_present = recipe(settings) == store.root.rpartition("/")[2]
    except (FlightidError, OSError):
        return ()  # A study that cannot be read is the run's to complain of.
    if is_present:
        return ()
    said = "the catalogue is of before [vehicles], the study or flightid changed: so it answers"
    return (
        Finding("earlier-records", Light.AMBER, said, "flightid fleet run takes all logs anew"),
    )


def has_catalogue(place: str) -> bool:
    """Whether a run has begun a catalogue there."""
    return store_at(place).exists(CURRENT)


def opened_store(place: str) -> Store:
    """The store of a catalogue that a run has noted as the one to be opened.

    Raises
    ------
    DataError
        There is no catalogue at this place.
    """
    try:
        store = store_at(place)
        if (store.n_bytes(CURRENT) or 0) > DOCUMENT_BYTES:
            raise ValueError(f"{CURRENT} is longer than any that a run writes")
        note = json.loads(store.read(CURRENT))
        own = str(note["current"])
        if not own.isalnum():
            raise ValueError(own)
    except (OSError, *BROKEN_JSON) as error:
        raise DataError(
            "there is no catalogue of a fleet here",
            found=place,
            needed=f"a folder with {CURRENT}",
            action="flightid fleet run writes one",
        ) from error
    return store_at(f"{place.rstrip('/')}/{own}")
