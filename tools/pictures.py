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
    "--virtual-time-budget=60000",
)
PAGE_SIZE = (1180, 2700)
# File name -> (first line, last line) of the page's picture, in px.
SHOTS = {"report-result.png": (0, 1060), "report-model.png": (1080, 2480)}
SCALE = 0.7


def photograph(page: Path, picture: Path, size: tuple[int, int] = PAGE_SIZE) -> None:
    """Take one picture of a page, `size` in px."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("Chromium is not on this machine.")
    with tempfile.TemporaryDirectory() as profile:
        command = [
            browser,
            *OPTIONS,
            f"--user-data-dir={profile}",
            f"--window-size={size[0]},{size[1]}",
            f"--screenshot={picture}",
            page.resolve().as_uri(),
        ]
        subprocess.run(command, check=True, capture_output=True, timeout=120)


def keep(whole: Path, picture: Path, rows: tuple[int, int] | None = None) -> Path:
    """Keep a picture in few colours, the rare ones among them; of a page only some rows, shrunk."""
    with Image.open(whole) as image:
        first, last = rows or (0, image.height)
        part = image.convert("RGB").crop((0, first, image.width, last))
        if rows is not None:
            size = (round(part.width * SCALE), round(part.height * SCALE))
            part = part.resize(size, Image.Resampling.LANCZOS)
        part.quantize(128, Image.Quantize.MAXCOVERAGE).save(picture, optimize=True)
    size_bytes = picture.stat().st_size
    if size_bytes > MAXIMUM_BYTES:
        raise SystemExit(f"{picture.name} has {size_bytes} bytes, at most {MAXIMUM_BYTES} are kept")
    return picture


def main() -> None:
    """Take every picture of the README."""
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    PICTURES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "page.png"
        photograph(Path(sys.argv[1]), whole)
        for name, rows in SHOTS.items():
            picture = keep(whole, PICTURES / name, rows)
            print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
