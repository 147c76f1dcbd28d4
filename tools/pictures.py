"""Photograph a report for the README.

    python tools/pictures.py demo-output/report.html

Needs Chromium. Writes PNG files to docs/pictures; each must stay below 150 kB.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
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
)
PAGE_SIZE = (1180, 3800)
# File name -> (left, top, right, bottom) in the page's picture, px.
SHOTS = {"report-result.png": (0, 0, 1180, 1190), "report-model.png": (262, 2250, 1180, 3540)}
SCALE = 0.7
WAIT_S = 10.0
"""For pictures to be unpacked and drawn."""


class _Late(BaseHTTPRequestHandler):
    """Answers after `WAIT_S`."""

    def do_GET(self) -> None:
        time.sleep(WAIT_S)
        self.send_response(404)
        self.end_headers()


@contextmanager
def _shutter() -> Iterator[int]:
    """Port of a server on this machine that is slow to answer."""
    with ThreadingHTTPServer(("127.0.0.1", 0), _Late) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_port
        server.shutdown()


def photograph(page: Path, picture: Path, size: tuple[int, int] = PAGE_SIZE) -> None:
    """Take one picture of a page, `size` in px."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("Chromium is not on this machine.")
    with tempfile.TemporaryDirectory() as profile, _shutter() as port:
        # A page draws its pictures as they come into sight, after it has loaded: a frame of full
        # height shows them all, and a picture that never comes holds the shutter back.
        frame = Path(profile) / "frame.html"
        frame.write_text(
            f'<body style="margin:0"><iframe src="{page.resolve().as_uri()}" style="border:0" '
            f'width="{size[0]}" height="{size[1]}"></iframe>'
            f'<img src="http://127.0.0.1:{port}" width="1">',
            encoding="utf-8",
        )
        command = [
            browser,
            *OPTIONS,
            f"--user-data-dir={profile}",
            f"--window-size={size[0]},{size[1]}",
            f"--screenshot={picture}",
            frame.as_uri(),
        ]
        subprocess.run(command, check=True, capture_output=True, timeout=120)


def keep(whole: Path, picture: Path, box: tuple[int, int, int, int] | None = None) -> Path:
    """Keep a picture in few colours, the rare ones among them; of a page only a part, shrunk."""
    with Image.open(whole) as image:
        part = image.convert("RGB").crop(box)
        if box is not None:
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
        for name, box in SHOTS.items():
            picture = keep(whole, PICTURES / name, box)
            print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
