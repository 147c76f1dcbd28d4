"""What a screen of the page leaves when it is left while something is under way."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.reference.test_app_in_browser import Desk, desk, until
from tests.sweep_log import SweepFlight

__all__ = ["desk"]
pytestmark = pytest.mark.slow
LOGS = "/api/logs/"
HELD = """
window.held = [];
const asks = window.fetch;
window.fetch = async (path, options) => {
  const answer = await asks(path, options);
  if (!/api.logs.[0-9a-f]+$/.test(path)) return answer;
  const told = await answer.clone().json();
  const runs = told.jobs.some((each) => each.kind === "review");
  if (told.overview && runs) await new Promise((give) => held.push(give));
  return answer;
};
"""
"""Answers to Flight that were made while a job ran wait to be given."""
CLIPS = """
window.clips = [];
const draws = Path2D.prototype.rect;
Path2D.prototype.rect = function (x, y, width, height) {
  clips.push([x, x + width]);
  return draws.call(this, x, y, width, height);
};
"""
"""What lines with gaps are clipped to: the spans where they are drawn."""


def test_jobs_are_those_of_the_server_alone(desk: Desk, tmp_path: Path) -> None:
    """An answer to Flight that was made while a job ran comes after the job has ended."""
    window = desk.open()
    page, asked = window.page, []
    page.on("request", lambda each: asked.append(each.url.partition(LOGS)[2]))
    page.add_init_script(HELD)
    page.reload()
    page.locator(".drop").wait_for()
    page.set_input_files(
        "input[type=file]", SweepFlight(sweep_s=25.0, rate_hz=100.0).write(tmp_path)
    )
    until(page, lambda: page.evaluate("held.length"))
    page.get_by_role("navigation").get_by_role("link", name="Logs", exact=True).click()
    page.locator(".drop").wait_for()
    running = "fetch('/api/jobs').then((told) => told.json()).then((jobs) => jobs.length)"
    until(page, lambda: page.evaluate(running) == 0)
    page.evaluate("held.forEach((give) => give())")
    page.wait_for_timeout(1500)
    assert page.locator(".jobs").count() == 0
    assert "/fields" not in asked
    assert not window.complaints
    page.close()


def test_what_lies_beyond_the_band_is_not_drawn_across_it(desk: Desk, tmp_path: Path) -> None:
    path = SweepFlight(sweep_s=25.0, rate_hz=100.0).write(tmp_path)
    window = desk.open()
    page = window.page
    page.add_init_script(CLIPS)
    page.reload()
    page.set_input_files("input[type=file]", path)
    page.locator(".cards").wait_for()
    page.click("nav >> text=Response")
    page.locator(".key.grey").wait_for()
    page.locator(".uplot canvas").nth(2).wait_for()
    left = page.locator(".bode").bounding_box()["x"]
    boxes = [page.locator(".handle").nth(end).bounding_box() for end in (0, 1)]
    low, high = (each["x"] + each["width"] / 2.0 - left for each in boxes)
    until(page, lambda: page.evaluate("clips.length"))
    drawn = page.evaluate("clips")
    assert any(end < high for _, end in drawn)  # the left of the band is drawn, to its edge
    assert not [each for each in drawn if each[0] > low + 5.0 and each[1] < high - 5.0]
    page.close()


def test_what_was_typed_and_not_saved_is_given_back(desk: Desk, tmp_path: Path) -> None:
    path = SweepFlight(sweep_s=25.0, rate_hz=100.0).write(tmp_path)
    page = desk.open().page
    page.set_input_files("input[type=file]", path)
    page.locator(".cards").wait_for()
    page.click("nav >> text=Model")
    page.get_by_role("button", name="Edit", exact=True).click()
    study = page.get_by_label("Study file, to be written")
    before = study.input_value()
    study.press("Control+End")
    study.press_sequentially("# a thought")
    page.locator("summary", has_text="A model of your own").click()
    page.get_by_label("Model file").fill("# half a model")
    page.evaluate("window.scrollTo(0, 9999)")
    page.click("nav >> text=Verify")
    page.get_by_text("Typed before, and not saved yet").wait_for()
    assert page.evaluate("scrollY") == 0  # another screen begins at its head
    page.reload()
    assert study.input_value() == f"{before}# a thought"
    page.click("nav >> text=Model")
    page.get_by_text("Typed before, and not used yet").wait_for()
    assert page.get_by_label("Model file").input_value() == "# half a model"
    page.get_by_role("button", name="Save", exact=True).click()
    page.locator("pre .changed", has_text="# a thought").wait_for()
    page.get_by_label("Own model").get_by_role("button", name="Discard").click()
    page.reload()
    page.get_by_role("button", name="Edit", exact=True).wait_for()
    assert page.get_by_text("Typed before").count() == 0
    page.close()
