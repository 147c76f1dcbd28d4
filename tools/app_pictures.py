"""Photograph the local page for its documentation.

    python tools/app_pictures.py demo-output/flight.bin

Needs Chromium, the built page and the extra app. Writes PNG files to docs/pictures.
"""

from __future__ import annotations

import asyncio
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pictures import MAXIMUM_BYTES, PICTURES, ROOT
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from flightid.app.guard import Session
from flightid.app.page import page_files
from flightid.app.serving import bound_socket, server_of
from flightid.app.workspace import Workspace

SIZE = (1280, 860)
ARGUMENTS = ["--no-sandbox", "--disable-gpu"]
COLOURS = 96


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


def photograph(page: Page, name: str) -> None:
    """One picture, small enough for a repository."""
    target = PICTURES / name
    page.wait_for_timeout(1500)  # for plots to be drawn
    page.screenshot(path=target)
    with Image.open(target) as taken:
        taken.convert("RGB").quantize(COLOURS).save(target, optimize=True)
    if target.stat().st_size > MAXIMUM_BYTES:
        sys.exit(f"{target.name} takes {target.stat().st_size} bytes, at most {MAXIMUM_BYTES}")


def flight(page: Page) -> None:
    """The screen of a flight, its three cards filled."""
    page.click("tbody a")
    page.locator(".step").nth(2).wait_for(timeout=120_000)
    photograph(page, "app-flight.png")


def response(page: Page) -> None:
    """The screen of a frequency response, the direct estimate beside the instrument's."""
    page.click("nav >> text=Response")
    page.click("text=Direct beside instrument")
    page.locator("pre .changed", has_text="compare").wait_for()
    page.locator(".key.dashed").wait_for()
    page.wait_for_timeout(2000)  # for the bars that windows widen
    photograph(page, "app-response.png")


def records(page: Page, folder: Path) -> None:
    """The screen of a rig's records, its study written."""
    rig = ROOT / "examples" / "twin_rotor_linear" / "fly.py"
    subprocess.run([sys.executable, rig, folder / "rig"], check=True, capture_output=True)
    page.click("nav >> text=Logs")
    names = ("u1_prbs", "u1_doublet_pitch")
    page.set_input_files("input[type=file]", [folder / "rig" / f"{name}.csv" for name in names])
    page.click("text=Write the study")
    page.locator("#content .box").first.wait_for(timeout=120_000)
    photograph(page, "app-records.png")


def main(log: Path) -> None:
    """Take all pictures."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
        shutil.copy(log, Path(folder) / "flight.bin")
        with served(Path(folder)) as session:
            browser = tools.chromium.launch(
                executable_path=shutil.which("chromium"), args=ARGUMENTS
            )
            width, height = SIZE
            page = browser.new_page(viewport={"width": width, "height": height})
            page.goto(session.address)
            page.wait_for_selector("tbody a")
            flight(page)
            response(page)
            records(page, Path(folder))
            browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
