"""Photograph every screen of the local page for its documentation.

    python tools/app_pictures.py [FOLDER] [SCREEN ...]

FOLDER keeps what is flown and computed for the next time; without it all is made anew. Needs
Chromium, the built page and the extras app and fleet. Writes docs/pictures/app-SCREEN.png.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from app_screens import REST_MS, SCREENS
from app_stage import SIZE, Stage, staged
from pictures import MAXIMUM_BYTES, PICTURES
from PIL import Image

COLOURS, KMEANS = 256, 3
"""Rare colours among them, such as those of lines, and common ones exact."""


def photograph(stage: Stage, name: str) -> None:
    """What of a screen is in sight, small enough for a repository."""
    stage.page.set_viewport_size(SIZE)
    SCREENS[name](stage)
    stage.page.evaluate("scrollTo(0, 0); document.activeElement.blur()")
    stage.page.mouse.move(0.0, 0.0)
    stage.page.wait_for_timeout(REST_MS)
    target = PICTURES / f"app-{name}.png"
    stage.page.screenshot(path=target)
    with Image.open(target) as taken:
        few = taken.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, KMEANS)
        few.save(target, optimize=True)
    size_bytes = target.stat().st_size
    if size_bytes > MAXIMUM_BYTES:
        sys.exit(f"{target.name} has {size_bytes} bytes, at most {MAXIMUM_BYTES} are kept")
    print(f"{target.name}: {size_bytes / 1000:.0f} kB", flush=True)


def main(folder: Path, names: list[str]) -> None:
    """Take all pictures, or those that are named."""
    with staged(folder) as stage:
        # The first screen last: by then its folder holds flights, records and their lights.
        for name in names or sorted(SCREENS, key=lambda each: each == "logs"):
            photograph(stage, name)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, help="keeps what is flown and computed")
    parser.add_argument("screens", nargs="*", metavar="SCREEN", help=", ".join(SCREENS))
    asked = parser.parse_args()
    if unknown := [each for each in asked.screens if each not in SCREENS]:
        parser.error(f"no screen is called {unknown[0]}; there are {', '.join(SCREENS)}")
    with tempfile.TemporaryDirectory() as made:
        main(asked.folder or Path(made), asked.screens)
