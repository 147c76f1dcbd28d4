"""The demo's log dropped on the page, by mouse alone to the gains on disk: nothing is typed.

The whole flight of `make demo`: `nightly`; `benchmarks/app_demo.py` tells what it takes. A short
one, by keyboard, is in test_app_screens_in_browser.py.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from flightid.control.autopilots.parameter_files import read_parameters
from flightid.vehicles import fly_scenario, write_ardupilot_log
from tests.reference.test_app_in_browser import Desk, desk

__all__ = ["desk"]
PATIENCE_MS = 900_000


def _dropped(page: Any, log: Path) -> None:
    """A file let go over the page, as the desktop does it."""
    where = page.locator(".drop").bounding_box()
    session = page.context.new_cdp_session(page)
    for kind in ("dragEnter", "dragOver", "drop"):
        event = {
            "type": kind,
            "x": where["x"] + where["width"] / 2.0,
            "y": where["y"] + where["height"] / 2.0,
            "data": {"items": [], "files": [str(log)], "dragOperationsMask": 1},
        }
        session.send("Input.dispatchDragEvent", event)


def gains_by_mouse(desk: Desk, log: Path, folder: Path) -> Path:
    """From the dropped log to the file of step 1, as a mouse goes."""
    window = desk.open()
    page = window.page
    page.set_default_timeout(PATIENCE_MS)
    page.wait_for_selector(".drop")
    _dropped(page, log)
    page.locator(".cards").wait_for()
    page.get_by_role("navigation").get_by_role("link", name="Gains").click()
    download = page.get_by_role("button", name="Download step 1")
    with page.expect_download() as told:
        download.click()
    target = folder / "step-1.param"
    told.value.save_as(target)
    assert not window.complaints
    page.close()
    return target


def demo_log(folder: Path) -> Path:
    """The flight of `make demo`."""
    return write_ardupilot_log(fly_scenario("advised"), folder / "flight.bin")


@pytest.mark.nightly
def test_from_the_demo_dropped_to_downloaded_gains(desk: Desk, tmp_path: Path) -> None:
    gains = read_parameters(gains_by_mouse(desk, demo_log(tmp_path), tmp_path))
    assert gains["ATC_RAT_RLL_P"] > 1.1 * 0.09
    assert {"ATC_RAT_PIT_P", "ATC_RAT_YAW_P"} <= set(gains)
