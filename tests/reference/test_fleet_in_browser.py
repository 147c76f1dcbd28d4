"""A fleet in a real Chromium, by keyboard: lights, a vehicle, its log, a question, a run."""

from __future__ import annotations

import pytest

pytest.importorskip("duckdb", reason="the extra fleet is not installed")

from tests.fleet_workspace import write_fleet
from tests.reference.test_app_in_browser import Desk, _findings, desk
from tests.sweep_log import SweepFlight

__all__ = ["desk"]
PHONE = {"width": 390, "height": 844}


def test_from_a_fleet_to_a_vehicle_to_its_log(desk: Desk) -> None:
    log = SweepFlight(sweep_s=4.0, rate_hz=50.0).write(desk.folder)
    write_fleet(desk.folder, log)
    window = desk.open("#/fleet")
    page = window.page
    page.get_by_role("link", name="fleet.toml").press("Enter")
    page.get_by_text("63 logs, 60 with a model, of 3 vehicles").wait_for()
    name = "v02: roll control power"
    page.get_by_role("application", name=name).wait_for()
    assert "rate too low" in page.get_by_label("Logs that could not be used").inner_text()
    said = _findings(page)
    page.get_by_role("link", name="v02", exact=True).press("Enter")
    trend = page.get_by_label("Vehicle v02").get_by_role(
        "application", name="v02: roll control power"
    )
    assert "new motor on 2026-01-23" in str(trend.get_attribute("aria-label"))
    page.get_by_label("SELECT").fill("select vehicle, count(*) as n from logs group by all")
    page.get_by_label("SELECT").press("Control+Enter")
    page.get_by_text("4 rows in").wait_for()
    page.get_by_label("SELECT").fill("drop table logs")
    page.get_by_role("button", name="Ask").press("Enter")
    page.get_by_role("alert").filter(has_text="questions alone").wait_for()
    assert window.complaints.pop().startswith("Failed to load resource")  # it is a 422
    page.set_viewport_size(PHONE)
    said += _findings(page)
    assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]
    page.set_viewport_size({"width": 1280, "height": 800})
    page.get_by_role("button", name="Run: take what is missing").press("Enter")
    page.get_by_text("Last run from here: 0 logs, 0 of them in the catalogue before").wait_for()
    page.get_by_label("Flights of v02").get_by_role("link").press("Enter")
    page.wait_for_url("**/#/flight/*")
    assert not said
    assert not window.complaints
    page.close()
