"""Draw the gallery's pictures from the examples' own reports.

    python tools/gallery_pictures.py                  # run the examples first (some ten minutes)
    python tools/gallery_pictures.py --kept FOLDER    # take FOLDER/<example>/**/report.html

Needs Chromium. Writes PNG files to docs/pictures; each must stay below 150 kB.
"""

from __future__ import annotations

import argparse
import html
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from pictures import PICTURES, keep, photograph

from flightid.plot.graph_objects import plotting_library

ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "examples"
SIZE = (1040, 560)


class Shot(NamedTuple):
    """One picture: the first figure of a report whose caption begins like this."""

    picture: str
    example: str
    caption: str


# Commands that leave a report.html below the folder they run in, each in a copy of its example.
COMMANDS = {
    "twin_rotor_linear": ("fly.py records", "-m flightid --quiet run study.toml --output out"),
    "twin_rotor_rbf": ("fly.py records", "-m flightid --quiet run study.toml --output out"),
    "r50": ("fly.py", "-m flightid --quiet run study.toml --output out"),
    "ah64": ("fly.py", "-m flightid --quiet run study.toml --output out"),
    "quadrotor_grey_box": ("fly.py", "-m flightid --quiet run study.toml --output out"),
}
SHOTS = (
    Shot("twin-rotor-response.png", "twin_rotor_linear", "y1 to u1: estimate with its 95 % band"),
    Shot("twin-rotor-prediction.png", "twin_rotor_linear", "u1 3-2-1-1, short: measured"),
    Shot("narx-correlations.png", "twin_rotor_rbf", "Correlation functions of y1 and u1"),
    Shot("narx-prediction.png", "twin_rotor_rbf", "3-2-1-1: measured, and predicted"),
    Shot("r50-response.png", "r50", "p to lat: instrument estimate"),
    Shot("r50-modes.png", "r50", "Eigenvalues with 95 % regions, beside"),
    Shot("ah64-modes.png", "ah64", "Eigenvalues with 95 % regions, beside"),
    Shot("ah64-reduction.png", "ah64", "Average cost, and the worst insensitivity"),
    Shot("grey-box-intervals.png", "quadrotor_grey_box", "Estimates with 95 % intervals"),
    Shot("grey-box-prediction.png", "quadrotor_grey_box", "roll doublet: measured"),
)
FIGURE = re.compile(
    r"<figcaption>(?P<caption>.*?)</figcaption>\s*"
    r'<script type="application/json" data-plot="[^"]*">(?P<spec>.*?)</script>',
    re.DOTALL,
)


def figures(report: Path) -> dict[str, dict[str, Any]]:
    """Plotly figures of a report by their captions; of equal captions the first counts."""
    found: dict[str, dict[str, Any]] = {}
    for match in FIGURE.finditer(report.read_text(encoding="utf-8")):
        found.setdefault(html.unescape(match["caption"]).strip(), json.loads(match["spec"]))
    return found


def run_examples(folder: Path) -> None:
    """Run each example in a copy of its own, so that nothing is written into the tree."""
    for example, commands in COMMANDS.items():
        place = folder / example
        shutil.copytree(EXAMPLES / example, place)
        for command in commands:
            print(f"{example}: {command}", flush=True)
            subprocess.run([sys.executable, *command.split()], cwd=place, check=True)


def figure_page(spec: dict[str, Any], size: tuple[int, int]) -> str:
    """A page with one figure and nothing else, as readers see it on white paper."""
    layout = {**spec["layout"], "width": size[0], "height": size[1], "autosize": False}
    layout |= {"paper_bgcolor": "white", "plot_bgcolor": "white"}
    drawn = json.dumps({"data": spec["data"], "layout": layout}).replace("<", "\\u003c")
    return (
        '<!doctype html><meta charset="utf-8"><body style="margin:0"><div id="plot"></div>'
        f"<script>{plotting_library()}</script><script>const spec = {drawn};"
        'Plotly.newPlot("plot", spec.data, spec.layout, {staticPlot: true});</script>'
    )


def draw(shot: Shot, folder: Path) -> Path:
    """Draw one picture into docs/pictures."""
    report = next(iter(sorted((folder / shot.example).rglob("report.html"))), None)
    if report is None:
        raise SystemExit(f"{folder / shot.example} has no report.html: run its example there")
    drawn = figures(report)
    spec = next((spec for name, spec in drawn.items() if name.startswith(shot.caption)), None)
    if spec is None:
        known = "\n  ".join(drawn)
        raise SystemExit(f"{report} has no figure {shot.caption!r}; it has\n  {known}")
    height = int(spec["layout"].get("height") or SIZE[1])
    size = (SIZE[0], min(height, 720))
    with tempfile.TemporaryDirectory() as scratch:
        page, whole = Path(scratch) / "figure.html", Path(scratch) / "figure.png"
        page.write_text(figure_page(spec, size), encoding="utf-8")
        photograph(page, whole, size)
        return keep(whole, PICTURES / shot.picture)


def main() -> None:
    """Draw every picture of the gallery."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kept", type=Path, help="folder with the examples' outputs")
    kept = parser.parse_args().kept
    PICTURES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        folder = kept or Path(scratch)
        if kept is None:
            run_examples(folder)
        for shot in SHOTS:
            picture = draw(shot, folder)
            print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
