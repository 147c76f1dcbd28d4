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
# File name -> (part of the page, width, height in px).
SHOTS = {
    "report-result.png": ("", 1180, 720),
    "report-model.png": ("#part-2", 1180, 900),
}


def photograph(page: Path, part: str, size: tuple[int, int], picture: Path) -> None:
    """Take one picture of a part of a page."""
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
            page.resolve().as_uri() + part,
        ]
        subprocess.run(command, check=True, capture_output=True, timeout=120)


def main() -> None:
    """Take every picture of the README."""
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name, (part, width, height) in SHOTS.items():
        picture = PICTURES / name
        photograph(Path(sys.argv[1]), part, (width, height), picture)
        size = picture.stat().st_size
        print(f"{picture.relative_to(ROOT)}: {size / 1000:.0f} kB")
        if size > MAXIMUM_BYTES:
            raise SystemExit(f"{name} is larger than {MAXIMUM_BYTES / 1000:.0f} kB")


if __name__ == "__main__":
    main()
