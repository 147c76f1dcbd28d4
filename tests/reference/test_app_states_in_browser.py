"""Every screen in each of its states as axe-core sees it: wide and narrow, light and dark.

States are those that a walk to an answer does not pass: refusals, files that cannot be read, work
under way, long names, a fleet of hundreds, a server that has gone. Nothing serious is found,
nothing is wider than the window or its field, and what a stranger has named like a script is words.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("duckdb", reason="the extra fleet is not installed")

from tests.app_stage import LONG, MANY, PLANTED, Stage, furnish
from tests.reference.test_app_in_browser import AXE, SERIOUS, Desk, coloured, desk, held_work
from tests.reference.test_app_screens_in_browser import CLIPPED, CROWDED

__all__ = ["desk"]
pytestmark = pytest.mark.slow
SIZES = ((1440, 900), (390, 844))
THEMES = ("dark", "light")
RAN = "typeof hit !== 'undefined' || document.querySelector('img[src=x]') !== null"
FOUND = "axe.run(document, {resultTypes: ['violations']})"


def looked_at(page: Any, state: str) -> list[str]:
    """What is serious in any size and colour, and what is wider than the window."""
    said = [f"{state}: a name was run"] if page.evaluate(RAN) else []
    page.evaluate(AXE.read_text(encoding="utf-8"))
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(200)
        if more := page.evaluate(CROWDED):
            said.append(f"{state}, {width}: {more} px too wide")
        said += [f"{state}, {width}: clipped {each}" for each in page.evaluate(CLIPPED)]
        for theme in THEMES:
            coloured(page, theme)
            said += [
                f"{state}, {width}, {theme}: {each['id']}: {each['nodes'][0]['html'][:160]}"
                for each in page.evaluate(FOUND)["violations"]
                if each["impact"] in SERIOUS
            ]
    page.set_viewport_size({"width": 1280, "height": 800})
    return said


@pytest.fixture(scope="module")
def furnished(desk: Desk, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    stage = furnish(desk, tmp_path_factory.mktemp("made"))
    stage.know()
    yield stage
    stage.page.close()


def _of_folder(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open("")
    page.get_by_role("link", name=LONG, exact=True).wait_for()
    page.get_by_text("Not listed").wait_for()
    yield "every kind of file"
    page.set_input_files("input[type=file]", [stage.folder / "prbs.csv", _text(stage.folder)])
    page.get_by_role("alert").wait_for()
    yield "a file that is refused"
    stage.button("Remove from list: calm.bin").press("Enter")
    page.locator("summary", has_text="Off the list").press("Enter")
    page.get_by_label("Search logs").fill("no such log")
    page.get_by_text("No log of this folder has").wait_for()
    yield "taken off, and nothing found"
    stage.button("Put back calm.bin").press("Enter")
    stage.button("Put back calm.bin").wait_for(state="detached")


def _of_a_stranger(stage: Stage) -> Iterator[str]:
    """Names of a log, a column, an event, a vehicle and its model."""
    page = stage.page
    stage.open("")
    page.get_by_role("link", name=f"{PLANTED}.bin").press("Enter")
    page.locator(".cards").wait_for()
    yield "a log"
    stage.open("")
    table = stage.folder / f"{PLANTED}.csv"
    rows = "".join(f"{0.1 * k:.1f},{k // 9 % 2},{k % 7}\n" for k in range(400))
    table.write_text(f"time [s],{PLANTED} [V],{PLANTED}2 [<b>]\n{rows}")
    page.set_input_files("input[type=file]", table)
    page.get_by_label(f"Role of {PLANTED}", exact=True).wait_for()
    yield "columns"
    stage.open("fly")
    page.locator("#vehicle option", has_text=PLANTED).wait_for(state="attached")
    page.select_option(
        "#vehicle", label=page.locator("#vehicle option", has_text=PLANTED).inner_text()
    )
    yield "a vehicle"
    stage.open("fleet")
    page.get_by_role("link", name="fleet.toml").press("Enter")
    page.get_by_text(PLANTED).first.wait_for()
    yield "what was done"


def _text(folder: Path) -> Path:
    path = folder / "notes.pdf"
    path.write_bytes(b"%PDF-1.7 nothing that flies")
    return path


def _of_flight(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open(f"flight/{stage.logs['torn']}")
    page.get_by_role("button", name="Again").first.wait_for()
    yield "a log that cannot be read"
    stage.open(f"flight/{stage.logs['empty']}")
    page.get_by_placeholder("This log has no field").wait_for()
    yield "a log without a field"
    stage.open("flight/0000000000000000")
    page.get_by_role("alert").wait_for()
    yield "no such log"
    stage.open(f"flight/{stage.logs['calm']}")
    page.locator(".cards").wait_for()
    yield "a log without sweeps"
    stage.open(f"flight/{stage.logs['long']}")
    page.locator(".sweep").first.press("Enter")
    page.locator("summary", has_text="Filters on this flight").press("Enter")
    page.fill("#field", "IMU.GyrX - (")
    page.get_by_role("button", name="= IMU.GyrX - (").press("Enter")
    page.locator(".search .error").wait_for()
    yield "a span, filters, a formula that is refused"
    page.fill("#field", "imu gyr")
    page.get_by_label("Fields found").wait_for()
    stage.button("Keep as a layout …").press("Enter")
    page.get_by_label("Name of the layout").fill("é")
    yield "fields found, a name that is refused"
    page.get_by_label("Name of the layout").press("Escape")
    stage.open(f"flight/{stage.logs['first']}")
    page.locator("summary", has_text="Filters on this flight").press("Enter")
    cut = page.locator(".filters input").first
    cut.fill("-5")
    page.locator(".filters .error").first.wait_for()
    yield "a filter that cannot be"


def _of_response(stage: Stage) -> Iterator[str]:
    page = stage.page
    for name in ("calm", "first"):
        stage.open(f"response/{stage.logs[name]}")
        page.locator(".handle, main p").first.wait_for()
        if name == "calm":
            yield "no study"
    beside = stage.button("Direct beside instrument")
    if beside.get_attribute("aria-pressed") != "true":
        beside.press("Enter")
    page.locator(".key.dashed").first.wait_for()
    page.locator(".bode").focus()
    page.keyboard.press("+")
    page.keyboard.press("Shift+ArrowRight")
    stage.button("Whole response").wait_for()
    yield "two estimates, zoomed and read"
    stage.button("Edit").press("Enter")
    page.get_by_label("Study file, to be written").fill("[study]\ntilte = 1")
    stage.button("Save").press("Enter")
    page.get_by_role("alert").first.wait_for()
    yield "a study as text, refused"
    stage.button("Discard").press("Enter")


def _of_two_windows(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open(f"response/{stage.logs['first']}")
    page.locator("#n").wait_for()
    other = stage.desk.open(f"#/response/{stage.logs['first']}").page
    other.locator("#n").wait_for()
    other.fill("#n", str(int(other.input_value("#n")) + 1))
    other.press("#n", "Tab")
    other.wait_for_selector("pre .changed")
    other.close()
    page.fill("#least", "0.65")
    page.press("#least", "Tab")
    page.wait_for_selector("dialog[open]")
    yield "both have changed the study"
    stage.button("Keep theirs alone").press("Enter")
    page.wait_for_selector("dialog[open]", state="detached")


def _printed(page: Any) -> list[object]:
    """What a sheet shows of a dark page: its colours, px too wide, links of the screens."""
    coloured(page, "dark")
    page.set_viewport_size({"width": 718, "height": 1000})
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    links = page.locator("nav a:visible").count()
    seen = [page.evaluate("document.documentElement.dataset.theme"), page.evaluate(CROWDED), links]
    page.emulate_media(media="screen")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    coloured(page, "light")
    page.set_viewport_size({"width": 1280, "height": 800})
    return seen


def _of_gains(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open(f"gains/{stage.logs['first']}")
    stage.button("Download step 1 of 2").wait_for()
    yield "gains as found"
    assert _printed(page) == ["light", 0, 0], "colours, what is cut off, links on paper"
    page.locator("input[type=range]").first.press("End")
    page.get_by_text("Nothing to download").wait_for()
    yield "gains that are refused"
    stage.button("As found").press("Enter")
    stage.button("Download step 1 of 2").wait_for()
    with held_work():
        stage.button("firm").press("Enter")
        again = page.get_by_role("group", name="Tuning again")
        again.wait_for()
        yield "tuned again"
        again.get_by_role("button", name="Cancel").press("Enter")
        page.get_by_role("status").filter(has_text="Tuning again: cancelled.").wait_for()
        yield "cancelled"
    stage.button("balanced").press("Enter")
    stage.button("Download step 1 of 2").wait_for()


def _of_compare(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open(f"compare/{stage.logs['first']}")
    page.locator("select[aria-label='Flight after']").wait_for()
    yield "nothing chosen"
    page.locator("select[aria-label='Flight after'] option", has_text="second.bin").wait_for(
        state="attached"
    )
    name = page.locator("option", has_text="second.bin").get_attribute("value")
    page.select_option("select[aria-label='Flight after']", name)
    page.locator("section[aria-label=Numbers]").wait_for()
    yield "promised and flown"
    stage.open(f"compare/{stage.logs['first']}/{stage.logs['torn']}")
    page.get_by_role("alert").wait_for()
    yield "a log that cannot be read"


def _of_plan(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open(f"plan/{stage.logs['calm']}")
    page.locator("section[aria-label='What is asked for'], .error").first.wait_for()
    yield "an ordinary log"
    page.fill("#amplitude", "0.05")
    page.press("#amplitude", "Tab")
    page.locator("button:enabled", has_text="Undo").first.wait_for()
    page.reload()
    page.locator("#amplitude").wait_for()
    assert page.input_value("#amplitude") == "0.05", "of a log without a model too"
    yield "what is asked of an ordinary log"
    page.get_by_role("navigation").get_by_role("link", name="Report").press("Enter")
    stage.button("Run the study").wait_for()
    yield "a report without a model"
    stage.open(f"plan/{stage.logs['first']}")
    page.get_by_role("heading", name="This log already carries").wait_for()
    page.get_by_role("group", name="Axes").get_by_role("button", name="roll").press("Enter")
    page.locator("section[aria-label=Sweeps]").wait_for()
    for each in page.locator("summary").all():
        each.press("Enter")
    yield "sweeps and their settings"
    page.fill("#amplitude", "0.0001")
    page.press("#amplitude", "Tab")
    page.locator("h1", has_text="no-go").wait_for()
    yield "no-go"


def _of_model(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open(f"model/{stage.logs['first']}")
    page.locator("[aria-label='Prediction'] canvas").first.wait_for()
    cell = page.locator("table input[type=number], table input[type=text]").first
    cell.fill("1e9")
    cell.press("Tab")
    page.locator("td .error").wait_for()
    page.locator("[aria-label=Library] summary").press("Enter")
    page.locator("summary", has_text="A model of your own").press("Enter")
    own = page.get_by_label("Model file", exact=True)
    own.fill(own.input_value().replace('unit = "s"', 'unit = "m"'))
    page.locator("#own-said .error", has_text="Line").wait_for()
    yield "a value and a model that are refused, the library"
    stage.button("Fit and verify").or_(stage.button("Fit again")).press("Enter")
    page.get_by_role("group", name="Running the study").wait_for()
    yield "the study runs"
    page.get_by_role("group", name="Part of the fit").wait_for()
    parts = page.get_by_role("group", name="Part of the fit").get_by_role("button")
    for k in range(parts.count()):
        parts.nth(k).press("Enter")
        yield f"of the fit, {parts.nth(k).inner_text()}"


def _of_a_run(stage: Stage) -> Iterator[str]:
    page = stage.page
    for screen in ("verify", "report"):
        stage.open(f"{screen}/{stage.logs['long']}")
        stage.button("Fit and verify").wait_for()
        yield f"{screen}: nothing was run"
        stage.open(f"{screen}/{stage.logs['first']}")
        page.locator("figure .js-plotly-plot, main table").first.wait_for()
        parts = page.get_by_role("group", name="Part", exact=True).get_by_role("button")
        for k in range(parts.count()):
            parts.nth(k).press("Enter")
            page.locator("main figure .js-plotly-plot, main table").first.wait_for()
            yield f"{screen}: {parts.nth(k).inner_text()}"
        yield f"{screen}: a run"
    # Gains were tuned: what comes after the next flight is a screen as well.
    compare = page.locator("main").get_by_role("link", name="Compare")
    assert compare.get_attribute("href") == f"#/compare/{stage.logs['first']}"
    compare.press("Enter")
    page.locator("select[aria-label='Flight after']").wait_for()


def _of_records(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open(f"records/{stage.rig}")
    page.locator("select[aria-label='Role of drive']").wait_for()
    for name in ("drive", "swing"):
        page.select_option(f"select[aria-label='Role of {name}']", "left out")
    page.get_by_text("A study needs an input and an output").wait_for()
    yield "roles are missing"
    page.select_option("select[aria-label='Role of drive']", "input")
    page.select_option("select[aria-label='Role of swing']", "output")
    page.select_option("#place", label="steps.csv")
    page.locator(".fault", has_text="swing").first.wait_for()
    yield "a fault"
    stage.button("Write the study").press("Enter")
    trying = page.get_by_role("group", name="Trying structures")
    trying.or_(page.locator("#content .box")).first.wait_for()  # a quiet machine may be done
    yield "structures are tried"
    page.locator("#content .box").wait_for()
    stage.button("Take out prbs.csv").press("Enter")
    page.locator(".files .error").wait_for()
    yield "a study; a file that stays"


def _with_study(stage: Stage) -> None:
    """The study of the rig written, where no state before has done it."""
    page = stage.page
    stage.open(f"records/{stage.rig}")
    write = page.get_by_role("button", name="Write the study").or_(page.locator("#content .box"))
    write.first.wait_for()
    if not page.locator("#content .box").count():
        for name, role in (("drive", "input"), ("swing", "output")):
            page.select_option(f"select[aria-label='Role of {name}']", role)
        stage.button("Write the study").press("Enter")
        page.locator("#content .box").wait_for()


def _of_rig_gains(stage: Stage) -> Iterator[str]:
    page = stage.page
    _with_study(stage)
    stage.open(f"gains/{stage.rig}")
    refused = page.get_by_role("alert").filter(has_text="so no gains are made from it")
    refused.wait_for()
    refused.get_by_role("link", name="Records").wait_for()  # where a click bridges the spike
    yield "a fit that carries no gains"
    stage.open("")
    # A set is known by its first file: this is another one, of a name wider than a phone.
    alone = stage.folder / f"alone-{LONG.removesuffix('.bin')}.csv"
    alone.write_text("".join((stage.folder / "prbs.csv").read_text().splitlines(True)[:-1]))
    page.set_input_files("input[type=file]", alone)
    for name, role in (("drive", "input"), ("swing", "output")):
        page.select_option(f"select[aria-label='Role of {name}']", role)
    stage.button("Write the study").press("Enter")
    page.locator("#content .box").wait_for()
    yield "records of a long name"
    page.get_by_role("navigation").get_by_role("link", name="Gains").press("Enter")
    page.locator("#slider-Kp").wait_for()
    yield "gains of a rig"
    typed = page.get_by_label("Ki, value")
    typed.fill("1e9")
    typed.press("Tab")
    page.locator("#why-value-Ki").wait_for()
    page.locator("#slider-Kp").press("End")
    page.get_by_text("Nothing to download: the reason stands above.").wait_for()
    yield "gains of a rig, refused"
    alone_rig = page.url.rpartition("/")[2]
    stage.open(f"compare/{alone_rig}/{stage.rig}")
    page.get_by_role("alert").filter(has_text="was not run yet").wait_for()
    yield "studies that were not run"
    for rig in (alone_rig, stage.rig):
        stage.open(f"verify/{rig}")
        stage.button("Fit and verify").press("Enter")
        page.locator("main figure .js-plotly-plot, main table").first.wait_for()
    page.get_by_role("group", name="Part", exact=True).get_by_role("button", name="Modes").press(
        "Enter"
    )
    page.locator("main table th", has_text="damping").or_(
        page.locator("main table th", has_text="real")
    ).first.wait_for()
    yield "modes of a model without equations"
    stage.open(f"compare/{alone_rig}/{stage.rig}")
    page.locator(".verdict", has_text=f"{LONG.removesuffix('.bin')}.csv").wait_for()
    page.locator("th", has_text="after / before").first.wait_for()
    yield "two studies"


def _of_fleet(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open("fleet")
    page.get_by_role("link", name="fleet.toml").wait_for()
    yield "fleets of the folder"
    page.get_by_role("link", name="fleet.toml").press("Enter")
    page.get_by_text(f"of {MANY} vehicles").wait_for()
    yield f"{MANY} vehicles"
    stage.button(f"Show all {MANY}").press("Enter")
    page.get_by_role("link", name="v499", exact=True).wait_for()
    yield f"all {MANY}"
    page.get_by_role("link", name="v02", exact=True).press("Enter")
    page.get_by_label("Vehicle v02").get_by_role("application").first.wait_for()
    page.get_by_label("SELECT").fill("drop table logs")
    stage.button("Ask").press("Enter")
    page.get_by_role("alert").filter(has_text="questions alone").wait_for()
    yield "a vehicle, a question that is refused"


def _of_fly(stage: Stage) -> Iterator[str]:
    page = stage.page
    stage.open("fly")
    page.get_by_text("ready", exact=True).wait_for()
    for each in page.locator("aside summary").all():
        each.press("Enter")
    yield "ready, all that can be set"
    stage.button("Fly").press("Enter")
    page.get_by_text("flying", exact=True).wait_for()
    other = stage.desk.open("#/fly").page
    other.get_by_role("alert").filter(has_text="another window").wait_for()
    other.close()
    stage.button("Reset").press("Enter")
    page.get_by_role("group", name="Reset").wait_for()
    yield "flying, and asked before it ends"
    page.keyboard.press("Escape")
    stage.button("End and keep").press("Enter")
    page.get_by_text("landed", exact=True).wait_for()
    for question in ("Was it controllable?", "Adequate performance with a tolerable workload?"):
        page.get_by_role("group", name=question).get_by_role("button", name="Yes").press("Enter")
    page.get_by_role("group", name="Satisfactory").get_by_role("button", name="No").press("Enter")
    page.get_by_role("radio").first.press("Space")
    stage.button("Keep the rating").press("Enter")
    page.get_by_text("Kept beside the flight.").wait_for()
    yield "landed and rated"


def _of_a_server_that_has_gone(stage: Stage) -> Iterator[str]:
    page = stage.page
    page.route("**/api/**", lambda asked: asked.abort())
    page.route_web_socket("**/api/live", lambda socket: socket.close())
    stage.open(f"response/{stage.logs['first']}")
    page.get_by_role("alert").filter(has_text="did not answer").wait_for()
    yield "nobody answers"
    page.unroute_all()


SCREENS = {
    "folder": _of_folder, "flight": _of_flight, "response": _of_response,
    "stranger": _of_a_stranger, "two windows": _of_two_windows, "gains": _of_gains,
    "compare": _of_compare, "plan": _of_plan,
    "model": _of_model, "run": _of_a_run, "records": _of_records, "rig gains": _of_rig_gains,
    "fleet": _of_fleet, "fly": _of_fly, "gone": _of_a_server_that_has_gone,
}  # fmt: skip
"""In the order in which one finds what the one before has made."""


@pytest.mark.parametrize("screen", SCREENS)
def test_nothing_serious_in_any_state(furnished: Stage, screen: str) -> None:
    said: list[str] = []
    for state in SCREENS[screen](furnished):
        said += looked_at(furnished.page, state)
    assert said == []
