"""Photograph every screen of the local page at three widths, light and dark, to be looked at.

    python tools/app_looks.py FOLDER [SCREEN ...]

FOLDER keeps what is flown and computed, so that it is there the next time; pictures are
FOLDER/looks/SCREEN-WIDTH-COLOURS.png, of the whole page. Needs Chromium, the built page and the
extras app and fleet.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from app_screens import REST_MS, SCREENS
from app_stage import SIZE, Stage, staged

WIDTHS = {1440: 900, 1280: 720, 390: 844}
COLOURS = ("light", "dark")
WALK = """async () => {
  for (let y = 0; y < document.documentElement.scrollHeight; y += 300) {
    scrollTo(0, y);
    await new Promise((done) => setTimeout(done, 60));
  }
  scrollTo(0, 0);
}"""
"""Plots are drawn as they come into sight."""


def look(stage: Stage, name: str) -> None:
    """One screen, in all widths and colours."""
    page, folder = stage.page, stage.folder / "looks"
    SCREENS[name](stage)
    for width, height in WIDTHS.items():
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate(WALK)
        for colours in COLOURS:
            if page.evaluate("document.documentElement.dataset.theme") != colours:
                page.locator("button[aria-label$=colours]").click()
            page.evaluate("scrollTo(0, 0)")
            page.wait_for_timeout(REST_MS)
            page.screenshot(path=folder / f"{name}-{width}-{colours}.png", full_page=True)
    page.set_viewport_size(SIZE)


def main(folder: Path, names: list[str]) -> None:
    """Take all, or those that are named."""
    (folder / "looks").mkdir(parents=True, exist_ok=True)
    with staged(folder) as stage:
        for name in names or SCREENS:
            look(stage, name)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, help="keeps what is flown and computed")
    parser.add_argument("screens", nargs="*", metavar="SCREEN", help=", ".join(SCREENS))
    asked = parser.parse_args()
    if unknown := [each for each in asked.screens if each not in SCREENS]:
        parser.error(f"no screen is called {unknown[0]}; there are {', '.join(SCREENS)}")
    main(asked.folder, asked.screens)
