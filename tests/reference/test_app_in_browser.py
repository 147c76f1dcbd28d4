"""The local page in a real Chromium: from a dropped log to a dragged band, by mouse and keyboard.

Where Chromium, Playwright or the built page is missing these are skipped, with how to get it; with
FLIGHTID_BROWSER=required, as `.ci/run` has it, they fail.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import shutil
import signal
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from tests.contract.source import ROOT
from tests.sweep_log import SweepFlight

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
AXE = ROOT / "app" / "node_modules" / "axe-core" / "axe.min.js"
REQUIRED = os.environ.get("FLIGHTID_BROWSER") == "required"
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
SERIOUS = ("serious", "critical")
WAIT_MS = 120_000


def _missing() -> str:
    try:
        import fastapi  # noqa: F401
        import playwright.sync_api  # noqa: F401

        from flightid.app.page import page_files

        page_files()
    except ImportError as error:
        return f"no {error.name}: pip install 'flightid[app]' playwright"
    except ValueError as error:
        return str(error)
    return "" if CHROMIUM else "no Chromium: apt-get install chromium"


@dataclass
class Window:
    """A page of the browser, with what it complained about."""

    page: Any
    complaints: list[str] = field(default_factory=list)

    def watch(self) -> Window:
        self.page.on("console", self._console)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.set_default_timeout(WAIT_MS)
        return self

    def _console(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)


@dataclass
class Desk:
    """A browser and a workspace that is served to it."""

    browser: Any
    context: Any
    address: str
    folder: Path

    def open(self, place: str = "") -> Window:
        window = Window(self.context.new_page()).watch()
        window.page.goto(self.address.partition("?")[0] + place)
        return window

    @property
    def study(self) -> dict[str, Any]:
        """The study that was written last."""
        paths = (self.folder / "studies").glob("[!.]*.toml")
        path = max(paths, key=lambda each: each.stat().st_mtime_ns)
        return tomllib.loads(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    if missing := _missing():
        pytest.fail(missing) if REQUIRED else pytest.skip(missing)
    with opened_desk(tmp_path_factory.mktemp("workspace")) as made:
        yield made


@contextmanager
def opened_desk(folder: Path) -> Iterator[Desk]:
    """A browser before the page on a folder, with the cookie of its first visit."""
    from playwright.sync_api import sync_playwright

    from flightid.app.guard import Session
    from flightid.app.page import page_files
    from flightid.app.serving import bound_socket, server_of
    from flightid.app.workspace import Workspace

    folder.mkdir(exist_ok=True)
    bound = bound_socket(0)
    session = Session(bound.getsockname()[1])
    server = server_of(Workspace(folder), page_files(), session)
    thread = threading.Thread(
        target=lambda: asyncio.run(server.serve(sockets=[bound])), name=f"desk on {folder}"
    )
    thread.start()
    # Whatever fails in between: a server that goes on would keep the tests from ever ending.
    try:
        with sync_playwright() as tools:
            browser = tools.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            context = browser.new_context(viewport={"width": 1280, "height": 800})
            context.set_default_timeout(WAIT_MS)
            first = context.new_page()
            first.goto(session.address)
            first.wait_for_selector(".drop")
            first.close()
            yield Desk(browser, context, session.address, folder)
            browser.close()
    finally:
        server.should_exit = True
        thread.join()


def coloured(page: Any, theme: str) -> None:
    """Light or dark as a press of the button has it: charts take their ink from that too."""
    page.evaluate(
        "theme => document.documentElement.dataset.theme === theme"
        " || document.querySelector('button[aria-label$=colours]').click()",
        theme,
    )


def _findings(page: Any) -> list[str]:
    """Serious findings of axe-core on what is shown; in the dark, of colours alone."""
    found = []
    if not page.evaluate("'axe' in window"):
        page.evaluate(AXE.read_text(encoding="utf-8"))
    for theme, rules in (("dark", ", runOnly: ['color-contrast']"), ("light", "")):
        coloured(page, theme)
        told = page.evaluate(f"axe.run(document, {{resultTypes: ['violations']{rules}}})")
        found += [
            f"{theme}: {each['id']}: {each['nodes'][0]['html'][:120]}"
            for each in told["violations"]
            if each["impact"] in SERIOUS
        ]
    return found


@contextmanager
def held_work() -> Iterator[None]:
    """No work ends meanwhile: on a quiet machine a tuning ends before anybody can cancel it."""
    held = [each.pid for each in multiprocessing.active_children() if each.pid]
    assert held, "the page has no process to hold"
    for pid in held:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in held:
            os.kill(pid, signal.SIGCONT)


def until(page: Any, holds: Callable[[], bool]) -> None:
    """Wait for what no element shows, as long as for an element."""
    end = time.monotonic() + WAIT_MS / 1e3
    while not holds():
        assert time.monotonic() < end, "it never came to be"
        page.wait_for_timeout(100)


def zoomed_by_keys(chart: Any, whole: Any, reading: str = " s: ") -> None:
    """Plus, minus, an arrow and 0 on a chart, values by Shift; the whole by a button."""
    for back in ("-", "0"):
        chart.press("+")
        chart.press("ArrowLeft")
        whole.wait_for()
        chart.press(back)
        whole.wait_for(state="detached")
    chart.press("Shift+ArrowRight")
    chart.get_by_role("status").filter(has_text=reading).wait_for()
    chart.press("+")
    whole.click()
    whole.wait_for(state="detached")


GAPS_AT_ONCE = """
window.fetch = ((real) => async (path, options) => {
  const answer = await real(path, options);
  if (!/^\\/api\\/logs\\/[0-9a-f]{16}$/.test(path)) return answer;
  const told = await answer.json();
  const start = (told.overview?.span_s[0] ?? 0) + 1;
  const gap = (s) => ({ kind: "gap", axis: "", text: "", start_s: start, stop_s: start + s });
  told.overview?.blocks.push(gap(1), gap(2));
  return new Response(JSON.stringify(told));
})(window.fetch);
"""
"""Two messages that pause at one instant, as in PX4's logs: such a log never came into sight."""
HELD_BACK = """(() => {
  const place = Object.getOwnPropertyDescriptor(WebSocket.prototype, "onmessage");
  Object.defineProperty(WebSocket.prototype, "onmessage", { ...place, set(hear) {
    place.set.call(this, (event) => {
      if (window.held && JSON.parse(event.data).response) window.held.push(() => hear(event));
      else hear(event);
    });
  }});
})();"""
"""As on a machine with much to do: while there is `held`, answers wait in it."""
GYROS = "IMU.GyrX - IMU.GyrY"


def test_from_a_dropped_log_to_a_dragged_band(desk: Desk, tmp_path: Path) -> None:
    window = desk.open()
    page = window.page
    page.add_init_script(GAPS_AT_ONCE)
    page.add_init_script(HELD_BACK)
    page.reload()
    page.wait_for_selector(".empty")
    said = _findings(page)
    page.set_input_files(
        "input[type=file]", SweepFlight(sweep_s=25.0, rate_hz=100.0).write(tmp_path)
    )
    page.wait_for_selector(".cards")
    assert "can carry a model of roll, pitch and yaw" in page.inner_text("h1")
    page.locator(".uplot canvas").nth(1).wait_for()
    # Any field, by parts of its name and Enter.
    page.fill("#field", "imu gyrx")
    page.press("#field", "Enter")
    page.wait_for_selector("section[aria-label='Plot of IMU.GyrX'] canvas")
    # A formula of fields, and the plots that stand as a file by name.
    page.fill("#field", GYROS)
    page.press("#field", "Enter")
    page.wait_for_selector(f"section[aria-label='Plot of ={GYROS}'] canvas")
    # Both are tables of the study, which a run reports.
    until(page, lambda: len(desk.study.get("plot", [])) == 4)
    assert desk.study["plot"][2:] == [{"series": ["IMU.GyrX"]}, {"series": [f"={GYROS}"]}]
    page.click("text=Keep as a layout …")
    page.get_by_label("Name of the layout").fill("gyros, raw")
    page.get_by_text("A layout is a file:").wait_for()
    page.get_by_label("Name of the layout").fill("gyros")
    page.get_by_label("Name of the layout").press("Enter")
    page.get_by_text("plots/gyros.toml").wait_for()
    # A whole name is that field, whatever else begins so (RATE.PDes).
    page.fill("#field", "rate.p")
    page.press("#field", "Enter")
    page.wait_for_selector("section[aria-label='Plot of RATE.P'] canvas")
    assert f"={GYROS}" in (desk.folder / "plots" / "gyros.toml").read_text("utf-8")
    # By keyboard what a drag does by mouse, and the values at the cursor.
    chart = page.locator("[role=application][aria-label^='IMU.GyrX over time']")
    zoomed_by_keys(chart, page.locator(".plots").get_by_role("button", name="Whole flight"))
    said += _findings(page)
    # The strip by keys: a sweep is read where it begins, taken, and let go; Shift draws a span.
    strip = page.get_by_role("application", name="The flight over time")
    for key in ("Home", "PageDown", "PageDown"):
        strip.press(key)
    page.get_by_role("status").filter(has_text="injected sweep roll").wait_for()
    strip.press("Enter")
    page.get_by_role("group", name="Use this span").get_by_text("23.9 s chosen:").wait_for()
    strip.press("Escape")
    page.get_by_role("group", name="Use this span").wait_for(state="detached")
    strip.press("Shift+ArrowRight")
    strip.press("Shift+ArrowRight")
    page.get_by_role("group", name="Use this span").get_by_text("1.7 s chosen:").wait_for()
    strip.press("Escape")
    # A span is typed; the model is fitted on it; the change is taken back.
    before = desk.study
    page.locator("input[type=number]").nth(0).fill("40")
    page.locator("input[type=number]").nth(1).fill("55.5")
    page.locator("input[type=number]").nth(1).press("Tab")
    page.click("text=fit Roll rate")
    page.locator("pre .changed", has_text='["roll 40').wait_for()
    named = desk.study["model"][0]["identify"]
    assert {"name": named[0], "span_s": [40.0, 55.5]} in desk.study["segment"]
    # Twice at once takes two changes back, one after the other.
    page.click("text=fit Pitch rate")
    until(page, lambda: desk.study["model"][1]["identify"] == ["pitch 40 s to 55.5 s"])
    assert desk.study["model"][1]["identify"] == ["pitch 40 s to 55.5 s"]
    page.locator("pre .changed", has_text='["pitch 40').wait_for()
    page.get_by_role("button", name="Undo").dblclick()
    page.locator("pre .changed", has_text='["roll sweep"]').wait_for()
    assert desk.study == before
    # The band: by arrow key, then by the mouse.
    page.click("nav >> text=Response")
    page.wait_for_selector(".handle")
    page.locator(".uplot canvas").nth(2).wait_for()
    assert page.title().startswith("Response · sweeps.bin")
    chart = page.locator("[role=application][aria-label^='Gain, phase and coherence']")
    zoomed_by_keys(chart, page.get_by_role("button", name="Whole response"), " Hz: ")
    page.locator(".handle").nth(1).press("ArrowLeft")
    page.locator("pre .changed", has_text="band_rad_s").wait_for()
    low, high = desk.study["model"][0]["band_rad_s"]
    assert [low, high] == [
        before["model"][0]["band_rad_s"][0],
        pytest.approx(before["model"][0]["band_rad_s"][1] / 1.03, rel=1e-3),
    ]
    # A key that is held: one change under way, and the last value is the one that is stored.
    page.evaluate(
        """() => { const handle = document.querySelectorAll(".handle")[1];
        const held = () => new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true });
        for (let k = 0; k < 8; k++) handle.dispatchEvent(held()); }"""
    )
    until(page, lambda: desk.study["model"][0]["band_rad_s"][1] > 1.25 * high)
    high = desk.study["model"][0]["band_rad_s"][1]
    assert high == pytest.approx(before["model"][0]["band_rad_s"][1] * 1.03**7, rel=1e-2)
    assert not page.locator("dialog[open]").count()
    box = page.locator(".handle").nth(0).bounding_box()
    middle = (box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0)
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0] + 60.0, middle[1], steps=6)
    page.mouse.up()
    until(page, lambda: desk.study["model"][0]["band_rad_s"][0] != low)
    assert desk.study["model"][0]["band_rad_s"][0] > 1.05 * low
    assert desk.study["model"][0]["band_rad_s"][1] == high
    # What a layout names and this log lacks is in no line of Python either.
    layout = desk.folder / "plots" / "gyros.toml"
    named = layout.read_text("utf-8").replace('"IMU.GyrX"', '"NOT.There", "IMU.GyrX"')
    layout.write_text(named, "utf-8")
    # An answer that comes when the screen was left is heard by nobody, and nobody asks on.
    page.click("nav >> text=Flight")
    page.locator(".cards").wait_for()
    page.evaluate("() => { window.held = []; }")
    page.click("nav >> text=Response")
    until(page, lambda: page.evaluate("held.length > 0"))
    page.click("nav >> text=Flight")
    page.wait_for_selector("section[aria-label='Plot of RATE.P'] canvas")
    page.evaluate(
        "() => { const late = held; delete window.held; late.forEach((each) => each()); }"
    )
    page.locator("#layout").select_option("")
    page.locator("#layout").select_option("gyros")
    page.get_by_text("left out of its plots: NOT.There").wait_for()
    page.get_by_role("button", name="Python", exact=True).click()
    lines = page.locator("pre[aria-label='Python lines']").inner_text()
    assert 'log.table("IMU")["GyrX"]' in lines
    assert "There" not in lines
    said += _findings(page)
    assert not said
    assert not window.complaints
    page.close()


def test_a_second_window_overwrites_nothing(desk: Desk) -> None:
    place = f"#/response/{next((desk.folder / 'studies').glob('*.toml')).stem}"
    first, second = desk.open(place), desk.open(place)
    for window in (first, second):
        window.page.locator("#n").wait_for()
    first.page.fill("#n", "31")
    first.page.press("#n", "Tab")
    first.page.wait_for_selector("pre .changed")
    second.page.fill("#least", "0.7")
    second.page.press("#least", "Tab")
    second.page.wait_for_selector("dialog[open]")
    assert "n_omega = 31" in second.page.inner_text("dialog .theirs >> text=n_omega")
    assert "minimum_coherence = 0.7" in second.page.inner_text("dialog pre")
    second.page.keyboard.press("Escape")  # nothing is chosen, and nothing lost
    second.page.wait_for_selector("dialog[open]", state="detached")
    typed = second.page.get_by_label("Study file, to be written")
    until(second.page, lambda: typed.count() == 1)
    assert "minimum_coherence = 0.7" in typed.input_value()
    assert desk.study["model"][0]["response"] == {"n_omega": 31}
    second.page.get_by_role("button", name="Discard").click()
    second.page.fill("#least", "0.8")
    second.page.press("#least", "Tab")
    second.page.wait_for_selector("pre .changed")
    first.page.fill("#n", "32")  # of a version that is gone by now
    first.page.press("#n", "Tab")
    first.page.get_by_role("button", name="Take both").click()
    first.page.wait_for_selector("dialog[open]", state="detached")
    until(first.page, lambda: "n_omega = 32" in first.page.inner_text("pre"))
    assert desk.study["model"][0]["response"] == {"n_omega": 32, "minimum_coherence": 0.8}
    # A conflict itself is one answer of 409, which the browser writes down.
    assert all("409" in each for each in first.complaints + second.complaints)
    for window in (first, second):
        window.page.close()


def test_a_desk_that_cannot_be_opened_leaves_no_server(desk: Desk, tmp_path: Path) -> None:
    """A second browser of one thread is refused; its server would have kept pytest for good."""
    del desk
    folder = tmp_path / "second"
    with pytest.raises(Exception, match="Sync API"), opened_desk(folder):
        pass
    assert not [each.name for each in threading.enumerate() if str(folder) in each.name]


class _Stranger(BaseHTTPRequestHandler):
    """A page of another local port."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>stranger</title>")

    def log_message(self, format: str, *args: object) -> None:
        pass


TRIES = """async (ours) => {
  const told = {};
  const tried = async (name, call) => {
    try { const answer = await call(); told[name] = answer.type + answer.status; }
    catch (error) { told[name] = "refused"; }
  };
  const all = { credentials: "include" };
  await tried("read", () => fetch(ours + "/api/workspace", all));
  await tried("read blindly", () => fetch(ours + "/api/workspace", { ...all, mode: "no-cors" }));
  await tried("post", () => fetch(ours + "/api/jobs", { ...all, method: "POST", body: "{}" }));
  const put = { ...all, method: "PUT", body: "x" };
  await tried("put", () => fetch(ours + "/api/logs?name=a.bin", put));
  told.socket = await new Promise((done) => {
    const socket = new WebSocket(ours.replace("http", "ws") + "/api/live");
    socket.onopen = () => done("open");
    socket.onclose = () => done("refused");
  });
  told.frame = await new Promise((done) => {
    const frame = document.createElement("iframe");
    frame.src = ours + "/";
    frame.onload = () => {
      try { done(String(frame.contentDocument)); } catch { done("refused"); }
    };
    document.body.append(frame);
  });
  return told;
}"""


def test_a_page_of_another_local_port_gets_nothing(desk: Desk) -> None:
    """The browser sends it our cookie, as SameSite=Strict does not part ports."""
    logs = sorted((desk.folder / "logs").rglob("*"))
    # Chromium may open a connection ahead and ask nothing: one thread would wait for it for good.
    with ThreadingHTTPServer(("127.0.0.1", 0), _Stranger) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = desk.context.new_page()
        page.goto(f"http://127.0.0.1:{server.server_port}/")
        told = page.evaluate(TRIES, desk.address.partition("/?")[0])
        page.close()
        server.shutdown()
    assert set(told.values()) <= {"refused", "null"}, told
    assert sorted((desk.folder / "logs").rglob("*")) == logs
