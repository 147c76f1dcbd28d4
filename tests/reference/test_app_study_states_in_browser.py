"""The study of a log and of records as an editor leaves it, before a hand on the page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.reference.test_app_in_browser import Desk, desk, until
from tests.reference.test_app_screens_in_browser import SLOW_MS
from tests.sweep_log import SweepFlight

__all__ = ["desk"]
pytestmark = pytest.mark.slow
LOST, BOX = "Study that is lost", "Study file, to be written"
FALSE = ("names no model", "another model for", "knows no model")


def _log(page: Any, folder: Path) -> None:
    page.set_input_files("input[type=file]", SweepFlight(sweep_s=25.0, rate_hz=100.0).write(folder))
    page.locator(".cards").wait_for()
    page.get_by_role("button", name="Edit", exact=True).wait_for()


def _records(page: Any, folder: Path) -> None:
    table = folder / "rig.csv"
    rows = (f"{0.1 * k:.1f},{(3 * k) % 17 - 8},{(4 * k) % 17 - 8}\n" for k in range(200))
    table.write_text("time [s],u,y\n" + "".join(rows))
    page.set_input_files("input[type=file]", table)
    for name, role in (("u", "input"), ("y", "output")):
        page.get_by_label(f"Role of {name}", exact=True).select_option(role)
    page.get_by_role("button", name="Write the study").click()
    page.get_by_role("button", name="Propose anew").wait_for()


class _Hand:
    """A hand on the page of one study, and an editor beside it."""

    def __init__(self, page: Any, path: Path) -> None:
        self.page, self.path, self.text = page, path, path.read_text()
        self.lost, self.box = page.get_by_label(LOST), page.get_by_label(BOX)

    def press(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).first.click()

    def leave(self, text: str | None, state: str) -> None:
        """What an editor leaves, when the page is looked at again."""
        if text is None:
            self.path.unlink()
        else:
            self.path.write_text(text)
        self.page.evaluate("window.dispatchEvent(new Event('focus'))")
        self.lost.wait_for(state=state)

    def stands(self, text: str) -> None:
        until(self.page, lambda: self.path.exists() and self.path.read_text() == text)


@pytest.mark.parametrize(
    ("begin", "screens"),
    [
        (_log, ("response", "gains", "model", "verify", "report", "plan")),
        (_records, ("gains", "model", "report", "records")),
    ],
)
def test_a_study_in_every_state_is_told_and_no_text_of_it_goes(
    desk: Desk, tmp_path: Path, begin: Callable[[Any, Path], None], screens: tuple[str, ...]
) -> None:
    """The panel went with a *Save*, an editor's file with another, a text with a removal."""
    page = desk.open().page
    page.set_default_timeout(SLOW_MS)
    begin(page, tmp_path)
    log, place = page.url.rpartition("/")[2], page.url.partition("#")[0]
    hand = _Hand(page, desk.folder / "studies" / f"{log}.toml")
    slip = hand.text.replace('title = "', "title = ", 1) + "# of an editor\n"
    for screen in screens:
        page.goto(f"{place}#/{screen}/{log}")
        page.reload()
        page.get_by_role("heading", level=1).wait_for()
        # Removed, without anything typed: before a reload and after it.
        hand.leave(None, "visible")
        assert hand.box.input_value() == hand.text
        page.reload()
        hand.lost.get_by_text("as it stood last").wait_for()
        assert hand.box.input_value() == hand.text
        hand.leave(hand.text, "detached")
        page.reload()
        page.get_by_role("heading", level=1).wait_for()
        assert hand.box.count() == 0
        # A slip that is stored as it is.
        hand.leave(slip, "visible")
        hand.press("Save")
        hand.lost.get_by_text("Not written:").wait_for()
        assert hand.path.read_text() == slip
        assert hand.box.input_value() == slip
        said = page.inner_text("main")
        assert not [each for each in (*FALSE, ".draft-") if each in said]
        hand.leave(hand.text, "detached")
    _typed_over(hand, slip)
    page.close()


def _typed_over(hand: _Hand, slip: str) -> None:
    """A text that was typed, and a slip of an editor's other words."""
    page, mine = hand.page, hand.text + "# typed here\n"
    for seen in (True, False):
        hand.press("Edit")
        hand.box.fill(mine)
        if seen:
            hand.leave(slip, "visible")
            assert "# of an editor" in page.get_by_label("File as it stands").inner_text()
        else:
            hand.path.write_text(slip)
        hand.press("Save")
        both = page.locator("dialog[open] pre")
        both.wait_for()
        assert "# of an editor" in both.inner_text()
        assert "# typed here" in both.inner_text()
        assert hand.path.read_text() == slip
        page.keyboard.press("Escape")
        both.wait_for(state="detached")
        assert hand.box.input_value() == mine
        hand.press("Save")
        both.wait_for()
        hand.press("Keep mine alone")
        hand.stands(mine)
        hand.lost.wait_for(state="detached")
        assert hand.box.count() == 0
        hand.press("Undo")
        hand.lost.wait_for()
        assert hand.path.read_text() == slip
        assert hand.box.input_value() == slip
        hand.press("Undo, to the version before")
        hand.lost.wait_for(state="detached")
        hand.stands(hand.text)
    # Typed, then removed, then read by a page that is opened anew.
    hand.press("Edit")
    hand.box.fill(mine)
    hand.leave(None, "visible")
    page.wait_for_timeout(600)  # it is sent when a hand rests
    page.reload()
    hand.lost.get_by_text("as it was typed here").wait_for()
    assert hand.box.input_value() == mine
    hand.press("Write it again")
    hand.stands(mine)
    hand.lost.wait_for(state="detached")
    assert hand.box.count() == 0
