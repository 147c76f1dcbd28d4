"""The page in a real browser, from disk: the plots unpack and draw under the page's own policy."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories
from flightid.report.content import Document, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.report.html import to_html
from flightid.table import Column, Table

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


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_paper_shows_all_plots_and_columns_at_its_own_width(tmp_path: Path) -> None:
    """A browser takes the page when the event is over: what is drawn later is a blank on paper.

    What is wider than paper it cuts: tables are made smaller, and the widest lie on turned pages.
    """
    api = pytest.importorskip("playwright.sync_api")
    time_s = np.linspace(0.0, 9.0, 400)
    pictures = [
        figure_block(
            time_histories([Panel(f"s{k}", (Trace("a", time_s, np.sin(k * time_s), look.MODEL),))]),
            f"Lines {k}.",
            folded=k % 2 == 1,
        )
        for k in range(1, 9)
    ]
    tables = [
        TableBlock(Table(f"{n} columns", columns, (tuple(0.123456 * k for k in range(n)),)))
        for n in (3, 18, 40)
        for columns in [tuple(Column(f"name{k}") for k in range(n))]
    ]
    tables.append(
        TableBlock(Table("Hash", (Column("hash"), Column("made by")), (("a" * 300, ""),)))
    )
    file = tmp_path / "report.html"
    file.write_text(to_html(Document("Title", "", (Section("S", (*pictures, *tables)),))))
    with api.sync_playwright() as player:
        browser = player.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1440, "height": 500}, color_scheme="dark")
        page.goto(file.as_uri())
        page.wait_for_selector(".main-svg", timeout=60_000)
        # Frames in which what is in sight is drawn, and then nothing left to do.
        page.evaluate(
            """new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(
                () => requestIdleCallback(done))))"""
        )
        drawn, widths, paper, frames = page.evaluate(
            """() => {
                const plots = [...document.querySelectorAll(".plot")];
                const count = () => plots.filter((one) => one.querySelector(".main-svg")).length;
                const before = count();
                dispatchEvent(new Event("beforeprint"));
                const wide = plots.map((one) => one.querySelector(".main-svg")?.clientWidth ?? 0);
                const frames = [...document.querySelectorAll(".scroll")].map((one) => {
                    const aside = one.classList.contains("aside"), paper = aside ? 1190 : 870;
                    const zoom = Number(one.firstElementChild.style.zoom);
                    one.style.width = `${paper}px`;
                    return [one.scrollWidth - paper, zoom, aside];
                });
                return [before, wide, count(), frames];
            }"""
        )
        # Printed in the moment in which it is there: nothing has been unpacked yet.
        page.add_init_script(
            """addEventListener("DOMContentLoaded", () => {
                dispatchEvent(new Event("beforeprint"));
                const count = (what) => document.querySelectorAll(what).length;
                window.early = [count(".plot"), count(".plot .main-svg"), count(".modebar-btn")];
            })"""
        )
        page.goto(file.as_uri())
        plots, early, buttons = page.evaluate("window.early")
        apology = page.locator("#plain").is_visible()
        # The last line stands close below what is above it, or it takes a page of its own.
        page.emulate_media(media="print")
        # Paper is light, whatever the screen was.
        ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert ground == "rgb(255, 255, 255)"
        left_empty = page.evaluate(
            """document.querySelector("footer").getBoundingClientRect().top
               - document.querySelector("main > section").getBoundingClientRect().bottom"""
        )
        browser.close()
    assert left_empty < 24, "the footer alone on a page of paper"
    assert early >= plots == 8, "each plot has layers of its own"
    assert (buttons, apology) == (0, False)
    assert drawn < 8, "what is folded or below the screen is not drawn before"
    assert paper == 8
    assert max(widths) <= 880, "of a window 1440 px wide"
    assert [over <= 1 for over, _, _ in frames] == [True] * 4, frames
    assert [(zoom < 1, aside) for _, zoom, aside in frames] == [
        (False, False), (True, False), (True, True), (False, False),
    ]  # fmt: skip
