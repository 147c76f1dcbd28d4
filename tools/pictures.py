"""Photograph a report for the README.

    python tools/pictures.py demo-output/report.html

Needs Chromium. Writes PNG files to docs/pictures; each must stay below 150 kB.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parent.parent
PICTURES = ROOT / "docs" / "pictures"
MAXIMUM_BYTES = 150_000
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--virtual-time-budget=20000",
)
PAGE_SIZE = (1180, 2700)
# File name -> (first line, last line) of the page's picture, in px.
SHOTS = {"report-result.png": (0, 1060), "report-model.png": (1080, 2480)}
SCALE = 0.7


def photograph(page: Path, picture: Path) -> None:
    """Take one picture of a whole page."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("Chromium is not on this machine.")
    with tempfile.TemporaryDirectory() as profile:
        command = [
            browser,
            *OPTIONS,
            f"--user-data-dir={profile}",
            f"--window-size={PAGE_SIZE[0]},{PAGE_SIZE[1]}",
            f"--screenshot={picture}",
            page.resolve().as_uri(),
        ]
        subprocess.run(command, check=True, capture_output=True, timeout=120)


def cut(whole: Path, rows: tuple[int, int], picture: Path) -> None:
    """Cut rows out of the page's picture, shrink them and keep few colours: plots have few."""
    with Image.open(whole) as image:
        part = image.convert("RGB").crop((0, rows[0], image.width, rows[1]))
        size = (round(part.width * SCALE), round(part.height * SCALE))
        part.resize(size, Image.Resampling.LANCZOS).quantize(64).save(picture, optimize=True)


def main() -> None:
    """Take every picture of the README."""
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    PICTURES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "page.png"
        photograph(Path(sys.argv[1]), whole)
        for name, rows in SHOTS.items():
            picture = PICTURES / name
            cut(whole, rows, picture)
            size = picture.stat().st_size
            print(f"{picture.relative_to(ROOT)}: {size / 1000:.0f} kB")
            if size > MAXIMUM_BYTES:
                raise SystemExit(f"{name} is larger than {MAXIMUM_BYTES / 1000:.0f} kB")


if __name__ == "__main__":
    main()
