"""What a frame of the screen Fly costs the page, with scenery and without.

    python -m benchmarks.app_frames [SECONDS]      default: 8 s each, without a graphics card

*script* is the time of the page's own call a frame: the hand, the picture, the strip, the numbers.
*processor* is what the browser's processes take a frame, the software rasteriser with it; *between
frames* is wall time, which other work on the machine lengthens.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright
from tests.reference.test_app_in_browser import ARGUMENTS, CHROMIUM

from benchmarks.app_served import Served, started
from flightid.app.page import page_files

WATCH = """() => {
  const asked = window.requestAnimationFrame.bind(window);
  window.told = { script: [], at: [] };
  window.requestAnimationFrame = (call) => asked((now) => {
    const begun = performance.now();
    call(now);
    window.told.script.push(performance.now() - begun);
    window.told.at.push(begun);
  });
}"""
READ = """() => {
  const { script, at } = window.told;
  const beats = at.slice(1).map((each, k) => each - at[k]);
  const part = (all, q) => [...all].sort((a, b) => a - b)[Math.floor(q * (all.length - 1))];
  const told = { frames: script.length };
  for (const [name, all] of [["script", script], ["beat", beats]])
    for (const q of [0.5, 0.95]) told[`${name} ${100 * q} %`] = part(all, q);
  window.told.script.length = window.told.at.length = 0;
  return told;
}"""


def browsers_s() -> dict[str, float]:
    """Processor time of the browser's processes, s, by what they are."""
    found: dict[str, float] = {}
    for used, words in started().values():
        if "--type=" in words or "chrom" in words.split("\0")[0]:
            kind = words.partition("--type=")[2].replace("\0", " ").split(" ")[0] or "browser"
            found[kind] = found.get(kind, 0.0) + used
    return found


def measure(page: Any, seconds: float, title: str) -> None:
    """Watch so long, and print what a frame took."""
    page.evaluate(READ)
    before = browsers_s()
    page.wait_for_timeout(1000.0 * seconds)
    after, told = browsers_s(), page.evaluate(READ)
    frames = told["frames"]
    spent = {k: 1e3 * (after[k] - before.get(k, 0.0)) / max(1, frames) for k in after}
    parts = ", ".join(f"{kind} {ms:.1f}" for kind, ms in sorted(spent.items()) if ms >= 0.05)
    script, beat = ([told[f"{name} {q} %"] for q in (50, 95)] for name in ("script", "beat"))
    print(f"{title}: {frames / seconds:.0f} frames/s")
    print(f"  script a frame {script[0]:.2f} ms (95 %: {script[1]:.2f})")
    print(f"  between frames {beat[0]:.1f} ms (95 %: {beat[1]:.1f})")
    print(f"  processor a frame {sum(spent.values()):.1f} ms ({parts})", flush=True)


def main(seconds: float) -> None:
    """The first screen, then Fly on the plain horizon and over scenery."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
        served = Served(Path(folder), page_files())
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.add_init_script(f"({WATCH})()")
        page.goto(served.session.address)
        page.wait_for_selector(".drop", timeout=60_000)
        page.evaluate("(function beat() { requestAnimationFrame(beat); })()")
        measure(page, seconds, "an empty page")
        for scenery in ("off", "on"):
            page.evaluate(f"localStorage.setItem('flightid-scenery', '{scenery}')")
            page.goto(served.session.address.partition("?")[0] + "#/fly")
            page.reload()
            page.get_by_text("ready", exact=True).wait_for(timeout=60_000)
            time.sleep(2.0)
            page.get_by_role("button", name="Fly", exact=True).press("Enter")
            page.get_by_text("flying", exact=True).wait_for(timeout=60_000)
            page.keyboard.down("ArrowRight")
            page.wait_for_timeout(150)
            page.keyboard.up("ArrowRight")
            shown = page.locator("canvas.outside.shown").count()
            measure(page, seconds, "scenery" if shown else "plain horizon")
            page.get_by_role("button", name="End and keep").press("Enter")
            page.get_by_text("landed", exact=True).wait_for(timeout=60_000)
        browser.close()
        served.close()


if __name__ == "__main__":
    main(float(sys.argv[1]) if sys.argv[1:] else 8.0)
