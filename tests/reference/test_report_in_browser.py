"""The page in a real browser, from disk: the plots unpack and draw under the page's own policy."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories
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
    "--run-all-compositor-stages-before-draw",
    "--virtual-time-budget=20000",
    "--window-size=500,3000",
]


ATTEMPTS = 4


def _drawn(page: Path, profile: Path) -> str:
    command = [str(BROWSER), *QUIET, f"--user-data-dir={profile}", "--dump-dom", page.as_uri()]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return run.stdout


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
@pytest.mark.parametrize("packed", [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_plots_draw_from_disk(tmp_path: Path, packed: bool) -> None:
    titles = [f"signal {k}" for k in range(9)]
    made = time_histories(
        [Panel(title, (Trace("roll rate", np.arange(9.0), np.arange(9.0), look.MODEL),))
         for title in titles]
    )  # fmt: skip
    block = figure_block(made, "Lines.")
    page = tmp_path / "report.html"
    page.write_text(to_html(Document("Title", "", (Section("S", (block,)),)), packed=packed))
    # Plots are drawn when a frame shows them; a headless browser on a busy machine may dump a page
    # before its first frame. A page that cannot draw fails each attempt.
    for attempt in range(ATTEMPTS):
        shown = _drawn(page, tmp_path / f"profile{attempt}")
        after = shown.split('class="main-svg"', maxsplit=1)[-1]
        if "roll rate" in after and after != shown:
            break
    else:
        pytest.fail(f"no plot was drawn in {ATTEMPTS} attempts: {shown[-2000:]}")
    assert 'id="plain" hidden' in shown
    # On a phone's width the two columns stand below each other, each panel under its own title.
    assert [after.count(f">{title}<") for title in titles] == [1] * len(titles)
