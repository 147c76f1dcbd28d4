"""The screen Fly in a real Chromium: by keyboard alone from the first frame to a rated record."""

from __future__ import annotations

from typing import Any

import pytest

import flightid as fid
from flightid.study.pilot_settings import pilot_of
from tests.reference.test_app_in_browser import Desk, Window, _findings, desk

__all__ = ["desk"]
KEPT_S = 120


def test_by_keyboard_from_take_off_to_a_rated_record(desk: Desk) -> None:
    window = desk.open("#/fly")
    page = window.page
    page.get_by_text("ready", exact=True).wait_for()
    # A horizon without scenery is drawn at once on any machine; the scenery is looked at below.
    page.locator("canvas.outside.shown").or_(page.get_by_text("No scenery:")).wait_for()
    scenery = page.get_by_role("button", name="Scenery")
    if scenery.get_attribute("aria-pressed") == "true":
        scenery.press("Enter")
    page.locator("canvas.outside").wait_for(state="detached")
    said = _findings(page)
    start = page.get_by_role("button", name="Fly", exact=True)
    start.focus()
    page.keyboard.press("Enter")
    page.get_by_text("flying", exact=True).wait_for()
    # The keys are of the flight now: Space presses no button, above all none that starts anew.
    page.locator(".view:focus").wait_for()
    # Reset asks before it ends a flight, and the flight goes on meanwhile.
    page.get_by_role("button", name="Reset").press("Enter")
    page.get_by_role("group", name="Reset").get_by_role("button", name="Go on").press("Enter")
    page.locator(".view:focus").wait_for()
    # Escape takes the question back as well; without one it pauses, and the keys are the page's.
    page.get_by_role("button", name="Reset").press("Enter")
    page.keyboard.press("Escape")
    page.get_by_role("group", name="Reset").wait_for(state="detached")
    page.locator(".view:focus").wait_for()
    page.keyboard.press("Escape")
    page.get_by_text("paused", exact=True).wait_for()
    page.locator("button:focus", has_text="Pause").press("Enter")
    page.get_by_text("flying", exact=True).wait_for()
    page.locator(".view:focus").wait_for()
    assert len(list((desk.folder / "flights").iterdir())) == 1
    page.keyboard.down("ArrowRight")
    page.get_by_role("img", name="roll 25 %").wait_for()
    page.keyboard.up("ArrowRight")
    page.get_by_role("img", name="roll 0 %").wait_for()
    # With Shift a key reaches the end, as a gamepad does; let go of it, a quarter again.
    page.keyboard.down("Shift")
    page.keyboard.down("d")
    page.get_by_role("img", name="yaw 100 %").wait_for()
    page.keyboard.up("Shift")
    page.get_by_role("img", name="yaw 25 %").wait_for()
    page.keyboard.up("d")
    page.get_by_role("img", name="yaw 0 %").wait_for()
    page.keyboard.press("p")
    page.get_by_text("paused", exact=True).wait_for()
    assert _stands(page)
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
    # Which stick was swept, and which was not; numbers in a pilot's order.
    page.get_by_text("Not swept: lat, ped and col").wait_for()
    numbers = page.locator("section[aria-label=Instruments] dt").all_inner_texts()
    assert numbers[:6] == ["time", "roll", "pitch", "roll rate", "pitch rate", "yaw rate"]
    assert page.title() == "Fly · flightid"
    page.get_by_role("group", name="Was it controllable?").get_by_role("button", name="No").press(
        "Enter"
    )
    page.get_by_role("button", name="Keep the rating").press("Enter")
    page.get_by_text("Kept beside the flight.").wait_for()
    # What was flown stands there as a study, its rating with it.
    page.locator("pre[aria-label='Study file']", has_text="rating = 10").wait_for()
    said += _findings(page)
    (folder,) = (desk.folder / "flights").iterdir()
    (record,) = fid.read_records(folder / "flown.nc")
    assert 2.0 < record.duration_s < KEPT_S
    assert max(record["stick_lat"]) == pytest.approx(0.25 * 4.5, rel=0.02)
    assert max(abs(record["sweep_lon"])) > 0.0
    assert '"rating": 10' in (folder / "rating.json").read_text(encoding="utf-8")
    # Its study says what was flown and how it was rated; the page takes it up again.
    told = pilot_of(folder / "study.toml")
    assert told is not None
    assert told.rating is not None
    assert (told.vehicle, told.augmentation, told.rating.rating) == ("ah64_hover", True, 10)
    page.get_by_role("button", name="Augmentation").press("Enter")
    page.get_by_role("button", name="Augmentation", pressed=False).wait_for()
    page.get_by_role("button", name=f"Fly so, as {folder.name}").press("Enter")
    page.get_by_role("button", name="Augmentation", pressed=True).wait_for()
    # The flight is opened as records: its sticks and sweeps, whose model can be identified.
    page.get_by_role("button", name=f"Open {folder.name} under Records").press("Enter")
    page.get_by_role("heading", name=f"{folder.name}.nc").wait_for()
    page.get_by_role("combobox", name="Role of q").wait_for()
    assert page.get_by_role("combobox", name="Role of q").input_value() == "output"
    assert [each.name for each in (desk.folder / "records").rglob("*.nc")] == [f"{folder.name}.nc"]
    assert not said
    assert not own_complaints(window)
    page.close()


def _stands(page: Any) -> bool:
    """Whether the clock stands; ten times a second it is written, on a busy machine less often."""
    for _ in range(10):
        before = page.locator("dl dd").first.inner_text()
        page.wait_for_timeout(400)
        if page.locator("dl dd").first.inner_text() == before:
            page.wait_for_timeout(400)
            return bool(page.locator("dl dd").first.inner_text() == before)
    return False


MODEL = """
kind = "transfer"
name = "A roll rate"
source = "an exercise"
[inputs]
u = "V"
[outputs]
p = "rad/s"
[responses]
"p/u" = { gain = "K", numerator = [], denominator = ["s + a"] }
[parameters]
K = { value = 20.0, unit = "rad/s^2/V", status = "free" }
a = { value = 3.0, unit = "1/s", status = "free" }
"""
GREENER = """() => new Promise((done) => {
  const place = document.createElement("canvas");
  [place.width, place.height] = [64, 40];
  const pen = place.getContext("2d", { willReadFrequently: true });
  const share = (top) => {
    const told = pen.getImageData(0, top, 64, 10).data;
    let green = 0;
    for (let k = 0; k < told.length; k += 4) green += told[k + 1] > told[k + 2] ? 1 : 0;
    return green / (told.length / 4);
  };
  const look = () => {
    const outside = document.querySelector("canvas.outside");
    if (outside) pen.drawImage(outside, 0, 0, 64, 40);
    const drawn = pen.getImageData(32, 20, 1, 1).data.slice(0, 3).some((each) => each > 0);
    if (!outside || drawn) done(outside && [share(2), share(28)]);
    else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
})"""
"""What was drawn can be read in its own frame alone, and on a busy machine not every one draws.

Nothing where the machine drew so slowly meanwhile that the scenery was given up."""


def own_complaints(window: Window) -> list[str]:
    """Complaints of the page; a software driver tells how it copies pictures, as a warning."""
    return [each for each in window.complaints if "GL Driver Message" not in each]


def test_a_model_of_the_folder_flies_over_scenery(desk: Desk) -> None:
    """Sky above and fields below where there is WebGL, without a graphics card too."""
    (desk.folder / "models").mkdir(exist_ok=True)
    (desk.folder / "models" / "roll.toml").write_text(MODEL)
    window = desk.open("#/fly")
    page = window.page
    page.evaluate("localStorage.setItem('flightid-scenery', 'on')")
    page.reload()
    page.get_by_text("ready", exact=True).wait_for()
    page.locator("#vehicle option", has_text="Roll, models/").wait_for(state="attached")
    page.select_option("#vehicle", label="Roll, models/")
    page.locator("canvas.outside.shown").or_(page.get_by_text("No scenery:")).wait_for()
    page.get_by_role("button", name="Fly", exact=True).press("Enter")
    page.get_by_text("flying", exact=True).wait_for()
    page.locator("dl dd", has_text="0.0 s").first.wait_for(state="detached")
    if page.locator("canvas.outside.shown").count() and (seen := page.evaluate(GREENER)):
        assert seen == [0.0, pytest.approx(1.0, abs=0.2)]
    page.get_by_role("button", name="End and keep").press("Enter")
    page.get_by_text("landed", exact=True).wait_for()
    assert not own_complaints(window)
    page.close()
