"""What the screens of the local page are shown with: flown once, kept, and served as it is.

A flight of the demo, a second one with the first step of its gains, records of a rig and a small
fleet, all of simulated vehicles. What was computed is kept beside them, for the next time.
"""

from __future__ import annotations

import asyncio
import dataclasses
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from pictures import ROOT
from playwright.sync_api import Page, ViewportSize, sync_playwright

from flightid.app.guard import Session
from flightid.app.page import page_files
from flightid.app.serving import bound_socket, server_of
from flightid.app.workspace import Workspace
from flightid.control.autopilots.parameter_files import read_parameters
from flightid.vehicles import Autopilot, fly_scenario, write_ardupilot_log

EXAMPLES = ROOT / "examples"
ARGUMENTS = ["--no-sandbox", "--disable-gpu"]
SIZE: ViewportSize = {"width": 1280, "height": 860}
PATIENCE_MS = 900_000
FLEET = ("3", "8")
"""Vehicles and flights of each: one gets new propellers, one slows down, one log is cut."""
RIG = ("u1_prbs", "u1_doublet_pitch")


@contextmanager
def served(folder: Path) -> Iterator[Session]:
    """The page on a workspace, as `flightid app` serves it."""
    bound = bound_socket(0)
    session = Session(bound.getsockname()[1])
    server = server_of(Workspace(folder), page_files(), session)
    thread = threading.Thread(target=lambda: asyncio.run(server.serve(sockets=[bound])))
    thread.start()
    try:
        yield session
    finally:
        server.should_exit = True
        thread.join()


@dataclass
class Stage:
    """A page of the browser before two workspaces: of flights, and of a fleet.

    Parameters
    ----------
    page : Page
        Of the browser, with a cookie for both.
    flights, fleet : str
        Their addresses, without the token.
    folder : Path
        Holds the workspace ``flights``, and what is not dropped yet.
    """

    page: Page
    flights: str
    fleet: str
    folder: Path

    def open(self, place: str = "", *, fleet: bool = False) -> None:
        """One screen, by its address."""
        self.page.goto(f"{self.fleet if fleet else self.flights}#/{place}")

    @property
    def log(self) -> str:
        """The id of the demo's log."""
        self.open()
        link = self.page.get_by_role("link", name="flight.bin", exact=True)
        link.wait_for()
        return str(link.get_attribute("href")).rpartition("/")[2]

    def tuned_log(self, step: Path) -> Path:
        """The flight with the gains of a file of step 1, flown where there is none yet."""
        path = self.folder / "step-1.bin"
        if not path.exists():
            tuned = Autopilot().with_parameters(read_parameters(step))
            gains = {each.name: getattr(tuned, each.name) for each in dataclasses.fields(tuned)}
            write_ardupilot_log(fly_scenario("advised", seed=1, autopilot=gains), path)
        return path

    @property
    def rig_files(self) -> list[Path]:
        """Records of the twin rotor, to be dropped together."""
        return [self.folder / "rig" / f"{name}.csv" for name in RIG]


def _script(example: str, *arguments: str | Path) -> None:
    """Run what flies an example."""
    command = [sys.executable, EXAMPLES / example / "fly.py", *arguments]
    subprocess.run(command, check=True, capture_output=True)


def prepare(folder: Path) -> None:
    """Fly what is not there yet."""
    flights, fleet = folder / "flights", folder / "fleet"
    flights.mkdir(parents=True, exist_ok=True)
    if not (flights / "flight.bin").exists():
        write_ardupilot_log(fly_scenario("advised"), flights / "flight.bin")
    if not (folder / "rig").exists():
        _script("twin_rotor_linear", folder / "rig")
    if not (fleet / "fleet.toml").exists():
        _script("fleet", fleet / "logs", *FLEET)
        shutil.copy(EXAMPLES / "fleet" / "study.toml", fleet)
        said = (EXAMPLES / "fleet" / "fleet.toml").read_text(encoding="utf-8")
        title = said.replace("Twenty quadrotors, ten flights", "Three quadrotors, eight flights")
        (fleet / "fleet.toml").write_text(title, encoding="utf-8")
    command = [sys.executable, "-m", "flightid", "fleet", "run", str(fleet / "fleet.toml")]
    subprocess.run(command, check=True, capture_output=True)


@contextmanager
def staged(folder: Path) -> Iterator[Stage]:
    """A browser before all of it."""
    prepare(folder)
    with ExitStack() as open_ones:
        sessions = [open_ones.enter_context(served(folder / each)) for each in ("flights", "fleet")]
        tools = open_ones.enter_context(sync_playwright())
        browser = tools.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
        context = browser.new_context(viewport=SIZE, accept_downloads=True)
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        for session in sessions:
            page.goto(session.address)
            page.wait_for_selector(".drop")
        os.environ["HOME"] = str(folder)  # no name of a machine's folders in a picture
        flights, fleet = (session.address.partition("?")[0] for session in sessions)
        yield Stage(page, flights, fleet, folder)
        browser.close()
