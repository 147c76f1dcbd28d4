"""Where examples of `flightid.fleet` run: a folder with a fleet file, two logs and a catalogue."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from _pytest.doctest import DoctestItem

from tests.fleet_rows import fleet_rows

FLEET = '[fleet]\ntitle = "Survey"\nlogs = ["logs"]\n[questions]\ncovariates = ["battery"]\n'


@pytest.fixture(scope="session")
def fleet_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty flights of five vehicles in the catalogue, and two logs that nobody took yet."""
    # The process that hands out tests needs none of these.
    from flightid.fleet.catalogue.loose import write_loose  # noqa: PLC0415
    from flightid.fleet.catalogue.record import LogRecord  # noqa: PLC0415
    from flightid.fleet.opening import current_store  # noqa: PLC0415
    from flightid.fleet.settings import read_fleet  # noqa: PLC0415
    from tests.fleet_types import fleet_of  # noqa: PLC0415

    folder = tmp_path_factory.mktemp("fleet-examples")
    (folder / "fleet.toml").write_text(FLEET)
    (folder / "logs").mkdir()
    for name in ("V00", "V01"):
        (folder / "logs" / f"{name}-20260301.bin").write_bytes(name.encode())
    rows = fleet_rows(3, 5, 8)
    store = current_store(read_fleet(folder / "fleet.toml"))
    for log in [each["log"] for each in rows["logs"]]:
        own = {name: [e for e in table if e["log"] == log] for name, table in rows.items()}
        write_loose(store, LogRecord(log, own))
    fleet_of(folder, "quad", name="types.toml")
    return folder


@pytest.fixture(autouse=True)
def fleet_example(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Examples of the fleet run in a copy of that folder; all others are left alone."""
    node = request.node
    if not isinstance(node, DoctestItem) or not node.dtest.name.startswith("flightid.fleet"):
        return
    pytest.importorskip("duckdb")
    folder = tmp_path_factory.mktemp("example") / "here"
    shutil.copytree(request.getfixturevalue("fleet_folder"), folder)
    request.getfixturevalue("monkeypatch").chdir(folder)
