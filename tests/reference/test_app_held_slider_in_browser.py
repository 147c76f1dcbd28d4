"""A slider stays where the hand has it: no tuning that ends and no line that comes moves it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.reference.test_app_in_browser import Desk, desk
from tests.reference.test_app_screens_in_browser import SLOW_MS, _flown

__all__ = ["desk"]
pytestmark = pytest.mark.slow
OF_BEFORE = "The numbers shown are of the study before its last change."
TOLD = """() => { const told = window.told = new Set();
  const add = (each) => told.add(each.textContent);
  const read = () => document.querySelectorAll("p.old").forEach(add);
  read();
  const all = { subtree: true, childList: true, characterData: true };
  new MutationObserver(read).observe(document.body, all); }"""
"""Whatever is said of old numbers from now on."""
ASKED = "1 of the tunings that a hand asked for has ended"


def _pressed(page: Any, slider: Any, share: float) -> int:
    """A slider pressed at its handle and moved by a share of its length; still held."""
    box, now = slider.bounding_box(), int(slider.input_value())
    x, y = box["x"] + 8 + (box["width"] - 16) * now / 400, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + share * box["width"], y, steps=6)
    return int(slider.input_value())


def test_a_tuning_that_ends_moves_no_slider_under_the_hand(desk: Desk, tmp_path: Path) -> None:
    """It was thrown back, and what it had been moved to was lost."""
    page = desk.open().page
    page.set_default_timeout(SLOW_MS)
    page.set_input_files("input[type=file]", _flown(tmp_path, "first.bin"))
    page.locator(".cards").wait_for()
    log = page.url.rpartition("/")[2]
    page.goto(f"{page.url.partition('#')[0]}#/gains/{log}")
    page.get_by_role("button", name="Download step 1 of 2").wait_for()
    sliders = page.locator("input[type=range]")
    first, last = sliders.nth(0), sliders.nth(2)
    first.scroll_into_view_if_needed()
    places = [first.bounding_box()["y"], last.bounding_box()["y"]]
    with page.expect_response(lambda told: f"/api/studies/{log}" in told.url):
        _pressed(page, first, -0.05)
        page.mouse.up()
    page.get_by_text("of the study before its last change").first.wait_for()
    assert [first.bounding_box()["y"], last.bounding_box()["y"]] == places, "sliders moved"
    # What was released is in the file, and in the numbers: nothing says that they are of before it.
    assert page.get_by_role("button", name="As found").is_enabled()
    page.get_by_text("The numbers of roll are of its sliders as they stand").wait_for()
    page.evaluate(TOLD)
    held = _pressed(page, last, -0.12)
    page.wait_for_timeout(300)
    assert not [each for each in page.evaluate("() => [...window.told]") if OF_BEFORE in each]
    page.get_by_text("of the study before its last change").first.wait_for(state="detached")
    page.wait_for_timeout(500)
    assert int(last.input_value()) == held, ASKED
    name = str(last.get_attribute("id")).removeprefix("slider-")
    with page.expect_response(lambda told: f"/api/studies/{log}" in told.url):
        page.mouse.up()
    page.wait_for_timeout(500)
    assert int(last.input_value()) == held
    assert [first.bounding_box()["y"], last.bounding_box()["y"]] == places, "sliders moved"
    (study,) = (desk.folder / "studies").glob("[!.]*.toml")
    kept = tomllib.loads(study.read_text(encoding="utf-8"))["tune"]["by_hand"][name]
    assert kept < float(last.get_attribute("aria-valuetext").split()[0]) * 1.01
    page.close()
