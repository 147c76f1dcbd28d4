"""Screens that no walk of test_app_screens_in_browser.py passes, looked at in the same way.

Each control is reached by Tab, nothing is wider than a phone, axe-core finds nothing serious.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("duckdb", reason="the extra fleet is not installed")

from tests.fleet_workspace import write_fleet
from tests.reference.test_app_fly_in_browser import own_complaints
from tests.reference.test_app_in_browser import Desk, desk
from tests.reference.test_app_screens_in_browser import looked_at
from tests.reference.test_rigs_in_browser import rig_tables
from tests.sweep_log import SweepFlight

__all__ = ["desk"]
STICKS = tuple(f"fly: not reached by Tab: {each}" for each in ("W S heave", "arrows:", "SPAN"))
"""Drawn sticks and their knobs follow keys of the whole screen, wherever the focus is."""


@pytest.mark.nightly
def test_every_control_is_reached_by_keyboard(desk: Desk, tmp_path: Path) -> None:
    log = SweepFlight(sweep_s=25.0, rate_hz=100.0).write(desk.folder)
    write_fleet(desk.folder, log)
    window = desk.open()
    page = window.page
    page.get_by_role("link", name=log.name, exact=True).wait_for()
    said = looked_at(page)
    page.get_by_role("link", name=log.name, exact=True).press("Enter")
    page.locator(".cards").wait_for()
    said += looked_at(page)
    said += _of(page, "Response", page.locator(".handle").first)
    said += _of(page, "Fleet", page.get_by_role("link", name="fleet.toml"))
    page.get_by_role("link", name="fleet.toml").press("Enter")
    page.get_by_role("application", name="v02: roll control power").wait_for()
    said += looked_at(page)
    found = _of(page, "Fly", page.get_by_text("ready", exact=True))
    said += [each for each in found if not each.startswith(STICKS)]
    said += _of(page, "Logs", page.locator(".drop"))
    page.set_input_files("input[type=file]", rig_tables(tmp_path))
    page.select_option("select[aria-label='Role of drive']", "input")
    page.select_option("select[aria-label='Role of swing']", "output")
    page.locator(".uplot canvas").nth(1).wait_for()
    said += looked_at(page)
    assert said == []
    assert not own_complaints(window)
    page.close()


def _of(page: Any, screen: str, whole: Any) -> list[str]:
    page.get_by_role("navigation").get_by_role("link", name=screen, exact=True).press("Enter")
    whole.wait_for()
    return looked_at(page)
