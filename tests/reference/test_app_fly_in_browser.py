"""The screen Fly in a real Chromium: by keyboard alone from the first frame to a rated record."""

from __future__ import annotations

import pytest

import flightid as fid
from tests.reference.test_app_in_browser import Desk, _findings, desk

__all__ = ["desk"]
KEPT_S = 120


def test_by_keyboard_from_take_off_to_a_rated_record(desk: Desk) -> None:
    window = desk.open("#/fly")
    page = window.page
    page.get_by_text("ready", exact=True).wait_for()
    said = _findings(page)
    start = page.get_by_role("button", name="Fly", exact=True)
    start.focus()
    page.keyboard.press("Enter")
    page.get_by_text("flying", exact=True).wait_for()
    page.keyboard.down("ArrowRight")
    page.get_by_role("img", name="roll 25 %").wait_for()
    page.keyboard.up("ArrowRight")
    page.get_by_role("img", name="roll 0 %").wait_for()
    page.keyboard.press("p")
    page.get_by_text("paused", exact=True).wait_for()
    page.wait_for_timeout(400)  # numbers are written ten times a second
    stood = page.locator("dl dd").first.inner_text()
    page.wait_for_timeout(400)
    assert page.locator("dl dd").first.inner_text() == stood
    page.keyboard.press("p")
    page.get_by_text("flying", exact=True).wait_for()
    # A second window finds the seat taken, and says so.
    other = desk.open("#/fly")
    other.page.get_by_role("alert").filter(has_text="another window").wait_for()
    other.page.close()
    page.locator("summary", has_text="Sweep").focus()
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Start the sweep").focus()
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Stop the sweep").wait_for()
    page.wait_for_timeout(2500)
    page.get_by_role("button", name="End and keep").focus()
    page.keyboard.press("Enter")
    page.get_by_text("landed", exact=True).wait_for()
    page.get_by_role("link", name="record", exact=True).wait_for()
    page.get_by_role("group", name="Was it controllable?").get_by_role("button", name="No").press(
        "Enter"
    )
    page.get_by_role("button", name="Keep the rating").press("Enter")
    page.get_by_text("Kept beside the flight.").wait_for()
    said += _findings(page)
    (folder,) = (desk.folder / "flights").iterdir()
    (record,) = fid.read_records(folder / "flown.nc")
    assert 2.0 < record.duration_s < KEPT_S
    assert max(record["stick_lat"]) == pytest.approx(0.25 * 4.5, rel=0.02)
    assert max(abs(record["sweep_lon"])) > 0.0
    assert '"rating": 10' in (folder / "rating.json").read_text(encoding="utf-8")
    assert not said
    assert not window.complaints
    page.close()
