"""A study that somebody else changes while it is typed here: both are shown, none overwritten."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.reference.test_app_in_browser import Desk, desk
from tests.sweep_log import SweepFlight

__all__ = ["desk"]
pytestmark = pytest.mark.slow
BOX = "Study file, to be written"


@pytest.fixture(scope="module")
def place(desk: Desk, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Screen of a study with two keys that a hand changes."""
    page = desk.open().page
    log = SweepFlight(sweep_s=25.0, rate_hz=100.0).write(tmp_path_factory.mktemp("log"))
    page.set_input_files("input[type=file]", log)
    page.locator(".cards").wait_for()
    page.get_by_role("button", name="Edit", exact=True).wait_for()
    place = f"#/flight/{page.url.rpartition('/')[2]}"
    page.close()
    return place


def _written(desk: Desk, line: str) -> Path:
    """The study, as another program leaves it: with a line at its head."""
    (path,) = (desk.folder / "studies").glob("[!.]*.toml")
    lines = [each for each in path.read_text().split("\n") if not each.startswith("# seed")]
    path.write_text("\n".join([line, *lines]))
    tomllib.loads(path.read_text())
    return path


def _typed(page: Any, line: str) -> None:
    """A line below all others, in the editor."""
    page.get_by_role("button", name="Edit", exact=True).click()
    box = page.get_by_label(BOX)
    box.fill(f"{box.input_value()}{line}\n")


def test_what_another_window_wrote_is_not_lost_under_a_typed_text(desk: Desk, place: str) -> None:
    page = desk.open(place).page
    _typed(page, "# a thought of mine")
    path = _written(desk, "# seed = 2")
    save = page.get_by_role("button", name="Save", exact=True)
    save.click()
    page.wait_for_selector("dialog[open]")
    both = page.locator("dialog pre")
    assert "# seed = 2" in both.locator(".theirs").all_inner_texts()[0]
    assert "# a thought of mine" in both.locator(".mine").all_inner_texts()[-1]
    page.keyboard.press("Escape")
    page.wait_for_selector("dialog[open]", state="detached")
    page.get_by_text("The study has changed since this was typed").wait_for()
    assert "# a thought of mine" in page.get_by_label(BOX).input_value()
    assert "# a thought of mine" not in path.read_text()
    save.click()  # asks again, however often
    page.get_by_role("button", name="Take both").click()
    page.locator("pre .changed").first.wait_for()
    assert "# seed = 2" in path.read_text()
    assert "# a thought of mine" in path.read_text()
    assert page.get_by_label(BOX).count() == 0
    page.close()


def test_a_reload_asks_as_well_and_each_version_can_be_taken(desk: Desk, place: str) -> None:
    page = desk.open(place).page
    for choice, kept in (("Keep theirs alone", False), ("Keep mine alone", True)):
        _typed(page, f"# typed for {choice}")
        page.wait_for_timeout(600)  # it is sent when a hand rests
        path = _written(desk, f"# seed of {choice}")
        page.reload()
        page.get_by_text("The study has changed since this was typed").wait_for()
        page.get_by_role("button", name="Save", exact=True).click()
        page.wait_for_selector("dialog[open]")
        assert f"# seed of {choice}" in page.inner_text("dialog pre")
        assert f"# typed for {choice}" in page.inner_text("dialog pre")
        assert f"# typed for {choice}" not in path.read_text()
        page.get_by_role("button", name=choice).click()
        page.get_by_role("button", name="Edit", exact=True).wait_for()
        assert (f"# typed for {choice}" in path.read_text()) == kept
        assert (f"# seed of {choice}" in path.read_text()) != kept
    page.close()


def test_lines_that_both_changed_are_not_taken_together(desk: Desk, place: str) -> None:
    page = desk.open(place).page
    path = _written(desk, "# seed = 0")
    page.reload()
    page.get_by_role("button", name="Edit", exact=True).click()
    box = page.get_by_label(BOX)
    box.fill(box.input_value().replace("# seed = 0", "# seed = 1"))
    _written(desk, "# seed = 2")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_text("both changed the same lines").wait_for()
    assert page.get_by_role("button", name="Take both").count() == 0
    page.get_by_role("button", name="Not now").click()
    page.get_by_role("button", name="Discard").click()
    assert path.read_text().startswith("# seed = 2")
    page.close()


def test_what_two_windows_type_is_kept_for_each(desk: Desk, place: str) -> None:
    """The folder keeps one text of a study: *Discard* in one window took the other's away."""
    mine, other = desk.open(place).page, desk.open(place).page
    for page, line in ((mine, "# typed first"), (other, "# typed second")):
        _typed(page, line)
        page.wait_for_timeout(600)  # it is sent when a hand rests
    other.get_by_role("button", name="Discard", exact=True).click()
    other.wait_for_timeout(600)
    mine.reload()
    assert "# typed first" in mine.get_by_label(BOX).input_value()
    mine.get_by_role("button", name="Discard", exact=True).click()
    for page in (mine, other):
        page.close()
