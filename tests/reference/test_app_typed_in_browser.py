"""Numbers that are typed in pairs: what is refused stands with its range, and counts nowhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.reference.test_app_in_browser import Desk, desk, until
from tests.reference.test_app_screens_in_browser import SLOW_MS, _opened
from tests.sweep_log import SweepFlight

__all__ = ["desk"]
pytestmark = pytest.mark.slow


def _typed(page: Any, label: str, text: str) -> Any:
    field = page.get_by_label(label, exact=True)
    field.fill(text)
    field.press("Tab")
    return field


def _dropped(desk: Desk, folder: Path) -> Any:
    page = desk.open().page
    page.set_default_timeout(SLOW_MS)
    flown = SweepFlight(sweep_s=25.0, rate_hz=100.0).write(folder)
    page.set_input_files("input[type=file]", flown)
    page.wait_for_selector(".cards")
    until(page, lambda: len(desk.study["model"]) == 3)
    return page


def test_a_span_of_which_an_end_is_refused_is_used_by_nobody(desk: Desk, tmp_path: Path) -> None:
    """The fields said 500 to 420, the button fitted 10 to 420 s."""
    page = _dropped(desk, tmp_path)
    before = desk.study
    uses = page.get_by_role("group", name="Use this span")
    # A span: beyond the log, and the other end at a good place, which alone is no span either.
    _typed(page, "from", "30")
    uses.get_by_role("button", name="fit Roll rate").wait_for()
    begin = _typed(page, "from", "5000")
    end = _typed(page, "to", "42")
    assert (begin.input_value(), end.input_value()) == ("5000", "42")
    assert begin.get_attribute("aria-invalid") == "true"
    reason = page.get_by_role("alert").filter(has_text="from may be")
    assert reason.inner_text().endswith("stands.")
    assert begin.get_attribute("aria-describedby") == reason.get_attribute("id")
    assert uses.get_by_role("button", name="fit Roll rate").is_disabled()
    uses.get_by_text("Correct the typed span first").wait_for()
    _typed(page, "from", "32")
    reason.wait_for(state="detached")
    uses.get_by_text("10 s chosen:").wait_for()
    assert begin.get_attribute("aria-invalid") != "true"
    assert desk.study == before
    page.close()


def test_a_band_is_taken_as_both_fields_show_it_or_not_at_all(desk: Desk, tmp_path: Path) -> None:
    """Crossed, then beyond what the log shows: the study got an end that no field showed."""
    page = _dropped(desk, tmp_path)
    _opened(page, "Response")
    page.wait_for_selector(".handle")
    page.locator(".uplot canvas").nth(2).wait_for()
    band = desk.study["model"][0]["band_rad_s"]
    low = _typed(page, "Lowest, Hz", "20")
    high = page.get_by_label("Highest, Hz", exact=True)
    assert low.get_attribute("aria-invalid") == "true"
    page.get_by_role("alert").filter(has_text="stands").wait_for()
    _typed(page, "Highest, Hz", "500")
    assert high.get_attribute("aria-invalid") == "true"
    page.get_by_role("alert").filter(has_text="Highest may be").wait_for()
    assert (low.input_value(), high.input_value()) == ("20", "500")
    page.wait_for_timeout(500)
    assert desk.study["model"][0]["band_rad_s"] == band
    _typed(page, "Lowest, Hz", "0.5")
    _typed(page, "Highest, Hz", "5")
    until(page, lambda: desk.study["model"][0]["band_rad_s"] == [3.142, 31.42])
    assert not page.locator("[aria-invalid=true]").count()
    page.close()


def test_a_handle_that_is_taken_again_follows_the_hand(desk: Desk, tmp_path: Path) -> None:
    """What the first drag had stored came back meanwhile, and threw the handle there."""
    page = _dropped(desk, tmp_path)
    _opened(page, "Response")
    page.wait_for_selector(".handle")
    page.locator(".uplot canvas").nth(2).wait_for()
    handle = page.locator(".handle").nth(1)
    band = desk.study["model"][0]["band_rad_s"]

    def middle() -> tuple[float, float]:
        box = handle.bounding_box()
        return box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0

    x, y = middle()
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 60.0, y, steps=6)
    page.mouse.up()
    page.mouse.down()
    page.mouse.move(x - 80.0, y)
    until(page, lambda: desk.study["model"][0]["band_rad_s"] != band)
    page.wait_for_timeout(1000)
    assert abs(middle()[0] - (x - 80.0)) < 2.0
    stored = desk.study["model"][0]["band_rad_s"]
    page.mouse.up()
    until(page, lambda: desk.study["model"][0]["band_rad_s"][1] < stored[1])
    page.close()


def test_a_run_of_what_an_editor_changed_is_told_of_the_study_as_it_stands(
    desk: Desk, tmp_path: Path
) -> None:
    """The page kept the text of before, and called the numbers of the file those of before."""
    page = _dropped(desk, tmp_path)
    page.wait_for_selector(".cards")
    log = page.url.rpartition("/")[2]
    page.goto(f"{page.url.partition('#')[0]}#/verify/{log}")
    again = page.get_by_role("button", name="Fit again")
    again.or_(page.get_by_role("button", name="Fit and verify")).first.press("Enter")
    page.locator("main table").first.wait_for()
    path = desk.folder / "studies" / f"{log}.toml"
    path.write_text(path.read_text(encoding="utf-8") + "\n# by an editor\n", encoding="utf-8")
    with page.expect_response(lambda told: told.request.method == "POST" and "run" in told.url):
        again.press("Enter")
    page.get_by_text("# by an editor").wait_for(state="attached")
    page.wait_for_timeout(1500)
    assert page.get_by_text("these numbers are of the one before").count() == 0
