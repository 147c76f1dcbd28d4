"""The log that `make demo` leaves, flown once for all texts that read it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from flightid.vehicles import Flight, PilotDoublet, SidActivation, fly, write_ardupilot_log

STUDY = Path(__file__).parent.parent.parent / "examples" / "quadrotor_rig" / "study.toml"


@pytest.fixture(scope="session")
def demo_flight() -> Flight:
    """The flight of the demo's study."""
    plan = tomllib.loads(STUDY.read_text(encoding="utf-8"))["flight"]
    return fly(
        runs=[SidActivation(**row) for row in plan["sweep"]],
        doublets=[PilotDoublet(**row) for row in plan["doublet"]],
        log_every=plan["log_every"],
        seed=plan["seed"],
    )


@pytest.fixture(scope="session")
def demo_output(demo_flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder `demo-output` with the log of that flight, as `make demo` leaves it."""
    folder = tmp_path_factory.mktemp("demo") / "demo-output"
    folder.mkdir()
    write_ardupilot_log(demo_flight, folder / "flight.bin")
    return folder
