"""Photograph every screen of the local page at three widths, light and dark, to be looked at.

    python tools/app_looks.py LOG FOLDER [SCREEN ...]

LOG holds sweeps and gains (`make demo` flies one). FOLDER/workspace is kept, so that what was
computed once is there the next time; pictures are FOLDER/SCREEN-WIDTH-COLOURS.png, of the whole
page. Needs Chromium, the built page and the extra app.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from app_pictures import ARGUMENTS, served
from playwright.sync_api import Page, sync_playwright

WIDTHS = {1440: 900, 1280: 720, 390: 844}
COLOURS = ("light", "dark")
PATIENCE_MS = 900_000
REST_MS = 1200
READY = {
    "logs": "tbody a",
    "flight": ".step",
    "response": ".handle",
    "gains": "section[aria-label=Margins]",
    "compare": "section[aria-label=Verdict]",
    "plan": "section[aria-label=Sweeps]",
    "model": "[aria-label=Prediction] canvas",
    "verify": "[aria-label=Part]",
    "report": "text=Open the report",
    "fly": "text=ready",
}
"""By the name in the address: what is there when a screen is whole."""


def look(page: Page, address: str, folder: Path, name: str, place: str) -> None:
    """One screen, in all widths and colours."""
    page.goto(f"{address}#/{place}")
    if name == "compare":
        page.get_by_role("button", name="Compare", exact=True).click()
    page.locator(READY[name]).first.wait_for(timeout=PATIENCE_MS)
    for width, height in WIDTHS.items():
        page.set_viewport_size({"width": width, "height": height})
        for colours in COLOURS:
            if page.evaluate("document.documentElement.dataset.theme") != colours:
                page.locator("button[aria-label$=colours]").click()
            page.wait_for_timeout(REST_MS)
            page.screenshot(path=folder / f"{name}-{width}-{colours}.png", full_page=True)
    page.set_viewport_size({"width": 1280, "height": 860})


def run(page: Page, address: str, log: str) -> None:
    """Run the study, unless it was."""
    page.goto(f"{address}#/report/{log}")
    page.locator("text=Runs the study as it stands").or_(page.locator(READY["report"])).wait_for()
    if not page.locator(READY["report"]).count():
        page.click("text=Fit and verify")
        page.locator(READY["report"]).wait_for(timeout=PATIENCE_MS)


def main(log: Path, folder: Path, screens: list[str]) -> None:
    """Take all, or those that are named."""
    space = folder / "workspace"
    space.mkdir(parents=True, exist_ok=True)
    if not (space / log.name).exists():
        shutil.copy(log, space / log.name)
    with served(space) as session, sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=shutil.which("chromium"), args=ARGUMENTS)
        page = browser.new_page(viewport={"width": 1280, "height": 860})
        page.set_default_timeout(PATIENCE_MS)
        page.goto(session.address)
        address = session.address.partition("?")[0]
        page.locator("tbody a", has_text=log.name).click()
        page.locator(READY["flight"]).first.wait_for()
        name = page.url.rpartition("/")[2]
        if {"verify", "report", "model"} & set(screens or READY):
            run(page, address, name)
        for each in screens or READY:
            of_log = each not in ("logs", "fly")
            place = f"{each}/{name}" if of_log else each if each != "logs" else ""
            look(page, address, folder, each, place + (f"/{name}" if each == "compare" else ""))
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
