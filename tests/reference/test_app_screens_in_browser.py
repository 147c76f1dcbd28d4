"""Every screen of one flight in Chromium, by keyboard: gains, flight after, plan, model, report.

Each is looked at as axe-core does, in both colours; each control is reached by Tab; on a phone
nothing is wider than the screen.
"""

from __future__ import annotations

import re
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest

from flightid.control.autopilots.parameter_files import read_parameters
from flightid.vehicles import Autopilot, PilotDoublet, SidActivation, fly
from flightid.vehicles.ardupilot_log import write_ardupilot_log
from tests.reference.test_app_in_browser import WAIT_MS, Desk, Window, _findings, desk, held_work

__all__ = ["desk"]
SLOW_MS = (
    2 * WAIT_MS
)  # below the limit of `make test` for one test: a wait that never ends has a name
MOST_TABS = 500
WALKS = 4  # a slow machine draws what was asked for while Tab goes round
PHONE = {"width": 390, "height": 844}
DESK = {"width": 1440, "height": 900}
REACHED = """() => { window.reached = new Set();
  document.addEventListener("focusin", (event) => window.reached.add(event.target)); }"""
AT_THE_END = "document.activeElement === document.body"
LEFT = """() => {
  const roles = ["slider", "button", "application"].map((each) => `[role=${each}]`);
  const can = ["a[href], button, input, select, summary, textarea", ...roles].join(", ");
  const seen = (each) =>
    each.checkVisibility({ visibilityProperty: true }) && each.getClientRects().length;
  const told = (each) =>
    (each.getAttribute("aria-label") || each.textContent || each.id || each.tagName).trim();
  const all = [...document.querySelectorAll("body *")].filter(seen);
  const controls = all.filter((each) => each.matches(can) && !each.disabled);
  const pressed = all.filter((each) =>
    ["pointer", "ew-resize", "grab"].includes(getComputedStyle(each).cursor)
    && !each.closest(`${can}, label, [tabindex='0']`) && !each.querySelector(can));
  return [...controls.filter((each) => !window.reached.has(each)), ...pressed].map(told);
}"""
CLIPPED = """() => {
  const pen = document.createElement("canvas").getContext("2d");
  const shown = (each) => each.value || each.placeholder;
  const told = (each) => `${each.getAttribute("aria-label") || each.id}: ${shown(each)}`;
  return [...document.querySelectorAll("input")]
    .filter((each) => ["text", "number", "search"].includes(each.type) && each.checkVisibility())
    .filter((each) => {
      const style = getComputedStyle(each);
      const edges = parseFloat(style.paddingLeft) + parseFloat(style.paddingRight);
      pen.font = style.font;
      return pen.measureText(shown(each)).width > each.clientWidth - edges + 1;
    })
    .map(told);
}"""
"""Fields that hold more than they show."""
CROWDED = """() => document.documentElement.scrollWidth - document.documentElement.clientWidth"""


def _flown(folder: Path, name: str, gains: Path | None = None) -> Path:
    """A flight of the rig's quadrotor: roll swept for half a minute, then moved by stick."""
    sweep = SidActivation(
        axis=10, start_s=5.0, magnitude=0.15, start_hz=0.15, stop_hz=12.0,
        fade_in_s=3.0, record_s=30.0, fade_out_s=1.0, leave_after_s=40.0,
    )  # fmt: skip
    sticks = [
        PilotDoublet("roll", start_s=47.0 + 3.37 * k, amplitude=0.25, width_s=0.3 + 0.25 * (k % 3))
        for k in range(10)
    ]
    autopilot = Autopilot().with_parameters({} if gains is None else read_parameters(gains))
    flight = fly(runs=[sweep], doublets=sticks, autopilot=autopilot, log_every=2, seed=1)
    return write_ardupilot_log(flight, folder / name)


def looked_at(page: Any) -> list[str]:
    """What is wrong with a screen: findings of axe, controls out of reach, a phone too narrow."""
    said = _findings(page)
    page.evaluate(REACHED)
    left: list[str] = []
    for walk in range(WALKS):  # to the end, once around, and again for what came meanwhile
        for _ in range(MOST_TABS):
            page.keyboard.press("Tab")
            if page.evaluate(AT_THE_END):
                break
        if walk and not (left := page.evaluate(LEFT)):
            break
    said += [f"not reached by Tab: {each}" for each in left]
    wide = page.viewport_size
    page.set_viewport_size(DESK)
    page.wait_for_timeout(300)
    said += [f"clipped at {DESK['width']}: {each}" for each in page.evaluate(CLIPPED)]
    page.set_viewport_size(PHONE)
    page.wait_for_timeout(300)
    if more := page.evaluate(CROWDED):
        said.append(f"{more} px wider than a phone")
    page.set_viewport_size(wide)
    return [f"{page.url.split('/')[4]}: {each}" for each in said]


def _study(desk: Desk, name: str) -> tuple[str, dict[str, Any]]:
    """A log by its name, and its study."""
    (log,) = (desk.folder / "logs").glob(f"*/{name}")
    text = (desk.folder / "studies" / f"{log.parent.name}.toml").read_text("utf-8")
    return log.parent.name, tomllib.loads(text)


def _opened(page: Any, screen: str) -> None:
    page.locator("nav a", has_text=screen).press("Enter")


def _saved(page: Any, button: str, folder: Path) -> Path:
    """What a button or link downloads, pressed by keyboard."""
    with page.expect_download() as told:
        page.get_by_text(button, exact=True).press("Enter")
    target = folder / str(told.value.suggested_filename)
    told.value.save_as(target)
    return target


def _watched(desk: Desk, place: str = "") -> Window:
    window = desk.open(place)
    window.page.set_default_timeout(SLOW_MS)
    return window


def test_from_a_dropped_log_to_gains_and_the_flight_with_them(desk: Desk, tmp_path: Path) -> None:
    """Without typing: flown, tuned, downloaded, flown again, compared with what was promised."""
    window = _watched(desk)
    page = window.page
    page.wait_for_selector(".drop")
    page.set_input_files("input[type=file]", _flown(tmp_path, "first.bin"))
    page.wait_for_selector(".cards")
    page.locator(".sweep").first.press("Enter")
    page.get_by_role("button", name="fit Roll rate").wait_for()
    said = looked_at(page)
    _opened(page, "Gains")
    page.get_by_role("button", name="Download step 1").wait_for()
    step = _saved(page, "Download step 1 of 2", tmp_path)
    new, old = read_parameters(step), read_parameters(_saved(page, "Its way back", tmp_path))
    assert set(old) == set(new)
    assert old["ATC_RAT_RLL_P"] == pytest.approx(0.09)
    assert new["ATC_RAT_RLL_P"] > 1.1 * old["ATC_RAT_RLL_P"]
    _zoomed(page, "Nichols chart", "Whole of the Nichols chart")
    _zoomed(page, "Rate, 1 rad/s asked", "Whole of Rate, 1 rad/s asked")
    said += looked_at(page)
    # At the end of its slider: red, and nothing to download on the page or behind it.
    slider = page.locator("input[type=range]").first
    name = str(slider.get_attribute("id")).removeprefix("slider-")
    slider.press("End")
    page.get_by_text("not met:").wait_for()
    page.get_by_text("Nothing to download").wait_for()
    log, study = _study(desk, "first.bin")
    assert name in study["tune"]["by_hand"]
    assert not page.get_by_role("button", name="Download step").count()
    refusal, files = page.evaluate(
        f"""fetch("/api/gains/{log}", {{method: "POST", body: "{{}}",
            headers: {{"content-type": "application/json"}}}}).then((told) => told.json())
            .then((told) => [told.gains.refusal, told.gains.files.length])"""
    )
    assert (bool(refusal), files) == (True, 0)
    said += _findings(page)
    page.get_by_role("button", name="As found").press("Enter")
    page.get_by_role("button", name="Download step 1").wait_for()
    assert _saved(page, "Download step 1 of 2", tmp_path).read_bytes() == step.read_bytes()
    # Another preset is tuned, which says how far it is and can be ended; one that was is there.
    with held_work():
        page.get_by_role("button", name="firm", exact=True).press("Enter")
        again = page.get_by_role("group", name="Tuning again")
        again.get_by_role("button", name="Cancel").press("Enter")
        page.get_by_role("status").filter(has_text="Tuning again: cancelled.").wait_for()
    page.get_by_text("still those of balanced; firm has none yet").wait_for()
    page.get_by_role("button", name="balanced", exact=True).press("Enter")
    page.get_by_role("status").filter(has_text="cancelled").wait_for(state="detached")
    page.get_by_role("button", name="Download step 1").wait_for()
    assert not page.get_by_role("group", name="Tuning again").count()
    said += _compared(page, _flown(tmp_path, "second.bin", step), tmp_path)
    said += _planned(page)
    assert said == []
    assert not window.complaints
    page.close()


def _zoomed(page: Any, chart: str, whole: str) -> None:
    """A small chart by the keys of every chart, the whole by 0 and by its button."""
    plot = page.locator(f"[role=application][aria-label^='{chart}']").first
    button = page.get_by_role("button", name=whole, exact=True)
    for back in (lambda: plot.press("0"), button.click):
        plot.press("+")
        plot.press("ArrowLeft")
        button.wait_for()
        back()
        button.wait_for(state="detached")


def _compared(page: Any, second: Path, folder: Path) -> list[str]:
    """The flight with step 1 beside what the model promises of it, then beside the one before."""
    _opened(page, "Compare")
    page.locator("select[aria-label='Flight after']").wait_for()
    page.set_input_files("input[type=file]", second)
    page.locator("section[aria-label=Verdict]").wait_for()
    numbers = page.locator("section[aria-label=Numbers]")
    assert numbers.locator("tbody tr").count() >= 4
    ends = re.findall(r"\((\S+) to (\S+)\)", numbers.inner_text())
    assert ends
    assert not [each for each in ends if each[0] == each[1]], "an interval without a width"
    assert "ATC_RAT_RLL_P" in _saved(page, "Download the way back", folder).read_text("utf-8")
    _zoomed(page, "Step of the roll rate loop", "Whole of roll rate")
    said = looked_at(page)
    page.get_by_role("button", name="how it flew").press("Enter")
    page.get_by_text("before (95 %)").wait_for()
    return said + _findings(page)


def _planned(page: Any) -> list[str]:
    """The next flight, of what has no model; an amplitude typed, its card; too small is no-go."""
    _opened(page, "Plan")
    page.get_by_role("heading", name="This log already carries roll").wait_for()
    said = looked_at(page)
    page.get_by_text("press roll under Asked for").wait_for()
    roll = page.get_by_role("group", name="Axes").get_by_role("button", name="roll")
    assert roll.get_attribute("aria-pressed") == "false"
    roll.press("Enter")
    page.get_by_text("further runs show whether flights agree").wait_for()
    # What repeats the sweep of the log foretells nothing, and says so.
    page.get_by_role("cell", name="seen in this log, so nothing is foretold").wait_for()
    amplitude = page.locator("td[data-label=Amplitude]")
    amplitude.first.wait_for()
    page.fill("#amplitude", "0.05")
    page.press("#amplitude", "Tab")
    amplitude.filter(has_text="0.05 of full").first.wait_for()
    said += looked_at(page)
    with page.expect_popup() as told:
        page.get_by_role("link", name="The card to print").press("Enter")
    told.value.wait_for_load_state()
    assert "0.05 of full" in told.value.inner_text("body")
    told.value.close()
    # What makes no band with the other end stays, marked, and is taken with what is typed there.
    page.fill("#low", "50")
    page.press("#low", "Tab")
    page.get_by_text("From has to be below To (To, where nothing is typed").wait_for()
    assert page.get_attribute("#low", "aria-invalid") == "true"
    page.fill("#high", "1")
    page.press("#high", "Tab")
    page.get_by_text("From has to be below To, and each above 0 Hz").wait_for()
    assert (page.input_value("#low"), page.input_value("#high")) == ("50", "1")
    page.fill("#low", "")
    page.press("#low", "Tab")
    page.get_by_text("From has to be below To").wait_for(state="detached")
    page.fill("#amplitude", "0.0001")
    page.press("#amplitude", "Tab")
    page.locator("h1", has_text="no-go").wait_for()
    assert not page.locator("section[aria-label='To take along'] button").count()
    page.get_by_role("button", name="Undo", exact=True).press("Enter")
    amplitude.filter(has_text="0.05 of full").first.wait_for()
    return said


def test_from_a_cell_of_a_model_to_its_report(desk: Desk, tmp_path: Path) -> None:
    """A start value edited, a faulty line told, the study run, read, and taken as one zip."""
    log, _ = _study(desk, "first.bin")
    window = _watched(desk, f"#/model/{log}")
    page = window.page
    cell = page.locator("table input[type=number], table input[type=text]").first
    cell.wait_for()
    name = str(cell.get_attribute("aria-label")).removeprefix("Start of ")
    before = cell.input_value()
    cell.fill("1e9")
    cell.press("Tab")
    page.locator("td .error", has_text="outside its bounds").wait_for()
    cell.fill(str(0.9 * float(before)))
    cell.press("Tab")
    page.locator("pre .changed", has_text=name).wait_for()
    kept = _study(desk, "first.bin")[1]["model"][0]["parameters"]
    assert kept[name]["value"] == pytest.approx(0.9 * float(before))
    page.locator("[aria-label='Prediction'] canvas").first.wait_for()
    page.locator("summary", has_text="A model of your own").press("Enter")
    own = page.get_by_label("Model file", exact=True)
    own.fill(own.input_value().replace('unit = "s"', 'unit = "m"'))
    page.locator("#own-said .error", has_text="Line").wait_for()
    said = looked_at(page)
    page.get_by_role("button", name="Undo").press("Enter")
    page.locator("pre", has_text=f"{name} = {{").wait_for(state="detached")
    page.get_by_role("button", name="Fit and verify").press("Enter")
    page.get_by_role("group", name="Part of the fit").wait_for()
    said += _findings(page)
    _opened(page, "Verify")
    parts = page.get_by_role("group", name="Part", exact=True).get_by_role("button")
    parts.first.wait_for()
    for k in range(parts.count()):
        parts.nth(k).press("Enter")
        page.locator("main figure .js-plotly-plot, main table").first.wait_for()
        said += looked_at(page) if k == 0 else _findings(page)
    _opened(page, "Report")
    page.get_by_role("link", name="Open the report").wait_for()
    said += looked_at(page)
    packed = zipfile.ZipFile(_saved(page, "Everything as one zip", tmp_path))
    assert f"studies/{log}.toml" in packed.namelist()
    assert any(each.endswith("report.html") for each in packed.namelist())
    with page.expect_popup() as told:
        page.get_by_role("link", name="Open the report").press("Enter")
    told.value.wait_for_load_state()
    assert told.value.locator("h1").first.inner_text()
    told.value.close()
    assert said == []
    assert not window.complaints
    page.close()
