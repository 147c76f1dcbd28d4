"""The page in a real browser, from disk: the plots unpack and draw under the page's own policy."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from flightid.plot import look
from flightid.report.content import Document, Section
from flightid.report.figures import figure_block
from flightid.report.html import to_html

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
QUIET = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
@pytest.mark.parametrize("packed", [True, False])
def test_plots_draw_from_disk(tmp_path: Path, packed: bool) -> None:
    made = look.figure()
    made.add_trace(look.line("roll rate", np.arange(9.0), np.arange(9.0) ** 2, colour=look.MODEL))
    block = figure_block(made, "A parabola.")
    page = tmp_path / "report.html"
    page.write_text(to_html(Document("Title", "", (Section("S", (block,)),)), packed=packed))
    run = subprocess.run(
        [
            str(BROWSER),
            *QUIET,
            f"--user-data-dir={tmp_path / 'profile'}",
            "--virtual-time-budget=20000",
            "--dump-dom",
            page.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert "main-svg" in run.stdout
    assert "roll rate" in run.stdout.split("main-svg", maxsplit=1)[1]
    assert 'id="plain" hidden' in run.stdout
