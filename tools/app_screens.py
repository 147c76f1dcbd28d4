"""Each screen of the local page brought to what there is to see on it, by its own controls."""

from __future__ import annotations

from collections.abc import Callable

from app_stage import Stage
from playwright.sync_api import TimeoutError

REST_MS = 1500
"""For plots to be drawn."""
LOADED_MS = 20_000
"""What an earlier run has found is there by then, on a loaded machine too."""


def logs(stage: Stage) -> None:
    """The first screen."""
    stage.open()
    stage.page.get_by_role("link", name="flight.bin", exact=True).wait_for()


def flight(stage: Stage) -> None:
    """The demo's flight, its three cards filled."""
    stage.open(f"flight/{stage.log}")
    stage.page.locator(".cards canvas").nth(2).wait_for()


def response(stage: Stage) -> None:
    """The direct estimate beside the instrument's."""
    stage.open(f"response/{stage.log}")
    page = stage.page
    page.locator(".handle").first.wait_for()
    beside = page.get_by_role("button", name="Direct beside instrument")
    if beside.get_attribute("aria-pressed") != "true":
        beside.click()
    page.locator(".key.dashed").first.wait_for()
    page.wait_for_timeout(2 * REST_MS)  # for the bars that windows widen


def gains(stage: Stage) -> None:
    """Gains as the search found them."""
    stage.open(f"gains/{stage.log}")
    stage.page.get_by_role("button", name="Download step 1").wait_for()


def compare(stage: Stage) -> None:
    """The flight with step 1 beside what the models promise of it."""
    gains(stage)
    page = stage.page
    with page.expect_download() as told:
        page.get_by_role("button", name="Download step 1").click()
    step = stage.folder / "step-1.param"
    told.value.save_as(step)
    second = stage.tuned_log(step)
    stage.open(f"compare/{stage.log}")
    page.locator("select[aria-label='Flight after']").wait_for()
    page.set_input_files("input[type=file]", second)
    page.locator("section[aria-label=Verdict]").wait_for()


def plan(stage: Stage) -> None:
    """The next flight: what the log allows, and a sweep of yaw that is asked for all the same."""
    stage.open(f"plan/{stage.log}")
    page = stage.page
    page.get_by_role("heading", name="This log already carries").wait_for()
    yaw = page.get_by_role("group", name="Axes").get_by_role("button", name="yaw")
    if yaw.get_attribute("aria-pressed") != "true":  # it stays in the study of the folder
        yaw.click()
    page.locator("section[aria-label=Sweeps]").wait_for()


def records(stage: Stage) -> None:
    """Records of a rig, their study written."""
    stage.open()
    page = stage.page
    page.wait_for_selector(".drop")
    page.set_input_files("input[type=file]", stage.rig_files)
    page.locator("select[aria-label^='Role of']").first.wait_for()
    page.wait_for_timeout(REST_MS)
    if not page.locator("#content .box").count():
        page.get_by_role("button", name="Write the study").click()
    page.locator("#content .box").first.wait_for()
    page.locator("section[aria-label=Signals] canvas").first.wait_for()


def rig_gains(stage: Stage) -> None:
    """A PID around the loops of the rig."""
    records(stage)
    stage.open(f"gains/{stage.page.url.rpartition('/')[2]}")
    stage.page.locator("section[aria-label=Margins]").wait_for()


def _ran(stage: Stage) -> None:
    """The study of the demo's log, run where it was not."""
    stage.open(f"report/{stage.log}")
    page = stage.page
    report = page.get_by_role("link", name="Open the report")
    try:
        report.wait_for(timeout=LOADED_MS)
    except TimeoutError:
        page.get_by_role("button", name="Fit and verify").click()
        report.wait_for()


def model(stage: Stage) -> None:
    """Equations, parameters and the fit of the first model."""
    _ran(stage)
    stage.open(f"model/{stage.log}")
    for drawn in ("[aria-label=Prediction] canvas", "figure .js-plotly-plot"):
        stage.page.locator(drawn).first.wait_for()


def verify(stage: Stage) -> None:
    """What the run found of the first model."""
    _ran(stage)
    stage.open(f"verify/{stage.log}")
    stage.page.locator("figure .js-plotly-plot").first.wait_for()


def report(stage: Stage) -> None:
    """The page that the run has written, and the zip."""
    _ran(stage)
    stage.page.locator("figure .js-plotly-plot").first.wait_for()


def fleet(stage: Stage) -> None:
    """The example's fleet, run once."""
    stage.open("fleet", fleet=True)
    page = stage.page
    page.get_by_role("link", name="fleet.toml").first.click()
    page.locator("canvas").first.wait_for()


def fly(stage: Stage) -> None:
    """A moment of a flight of the AH-64 with its augmentation, its stick moved."""
    stage.open("fly")
    page = stage.page
    page.reload()  # whatever flew before is let go
    page.get_by_text("ready", exact=True).wait_for()
    page.locator("canvas.outside.shown").or_(page.get_by_text("No scenery:")).first.wait_for()
    page.get_by_role("button", name="Fly", exact=True).click()
    page.get_by_text("flying", exact=True).wait_for()
    for key, held_ms in (("ArrowUp", 300), ("ArrowRight", 400)):
        page.keyboard.down(key)
        page.wait_for_timeout(held_ms)
        page.keyboard.up(key)
        page.wait_for_timeout(REST_MS)
    page.keyboard.press("p")
    page.get_by_text("paused", exact=True).wait_for()
    # Where it was too slow to fly by, what stands still can be drawn.
    scenery = page.get_by_role("button", name="Scenery")
    if scenery.get_attribute("aria-pressed") != "true":
        scenery.click()
    page.locator("canvas.outside.shown").or_(page.get_by_text("No scenery:")).first.wait_for()


SCREENS: dict[str, Callable[[Stage], None]] = {
    each.__name__: each
    for each in (
        logs, flight, response, gains, compare, plan, records, rig_gains, model, verify, report,
        fleet, fly,
    )
}  # fmt: skip
"""By the name in the address."""
