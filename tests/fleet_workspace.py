"""A workspace with a fleet whose truth is known; the log of one of its flights lies beside it."""

from __future__ import annotations

import hashlib
from pathlib import Path

from flightid.fleet.catalogue.loose import write_loose
from flightid.fleet.catalogue.record import LogRecord
from flightid.fleet.opening import current_store
from flightid.fleet.settings import read_fleet
from tests.fleet_rows import Rows, fleet_rows

FLEET = (
    '[fleet]\ntitle = "Survey"\nlogs = ["fleet-logs"]\n[questions]\ncovariates = ["battery"]\n'
    '[[event]]\ndate = "2026-01-23"\nwhat = "new motor"\nvehicle = "v02"\n'
)


def write_fleet(
    folder: Path, log: Path | None = None, flights: int = 20, vehicles: int = 3
) -> Path:
    """A fleet file of vehicles with its catalogue; v02's newest flight is of that log."""
    path = folder / "fleet.toml"
    path.write_text(FLEET)
    (folder / "fleet-logs").mkdir(exist_ok=True)
    rows = fleet_rows(3, vehicles, flights)
    store = current_store(read_fleet(path))
    flown = [each["log"] for each in rows["logs"] if each["vehicle"] == "v02"]
    names = {} if log is None else {flown[-1]: hashlib.sha256(log.read_bytes()).hexdigest()}
    own: dict[str, Rows] = {}
    for table, held in rows.items():
        for each in held:
            name = names.get(each["log"], each["log"])
            kept = own.setdefault(name, {every: [] for every in rows})
            kept[table].append(each | {"log": name})
    for name, tables in own.items():
        write_loose(store, LogRecord(name, tables))
    return path
