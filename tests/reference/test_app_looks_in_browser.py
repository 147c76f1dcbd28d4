"""Screens of the page beside their pictures of before, loosely: 32 × 20 greys of each.

Fonts, dates and numbers may differ; a screen without its charts, its colours or its order may not.
FLIGHTID_LOOKS=write writes the pictures anew, after somebody has looked at the screens.
"""

from __future__ import annotations

import base64
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.reference.test_app_in_browser import Desk, coloured, desk
from tests.sweep_log import SweepFlight

__all__ = ["desk"]
pytestmark = pytest.mark.slow
KEPT = Path(__file__).with_name("app_looks.json")
COLUMNS, ROWS = 32, 20
ALIKE = 0.8
"""Least correlation of the greys of a screen with those of before."""
REST_MS = 1500
SIZES = {"wide": (1280, 800), "phone": (390, 844)}
DRAWN = {
    "": ".drop",
    "flight": "main .uplot canvas",
    "response": ".handle",
    "plan": "h1",
    "model": "[aria-label=Prediction] canvas",
}
"""What tells that a screen is there, by its place in the address."""
GREYS = """async ([picture, columns, rows]) => {
  const image = new Image();
  image.src = `data:image/png;base64,${picture}`;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [columns, rows];
  const drawn = canvas.getContext('2d');
  drawn.imageSmoothingQuality = 'high';
  drawn.drawImage(image, 0, 0, columns, rows);
  const { data } = drawn.getImageData(0, 0, columns, rows);
  return Array.from({ length: columns * rows }, (_, k) =>
    Math.round(0.3 * data[4 * k] + 0.59 * data[4 * k + 1] + 0.11 * data[4 * k + 2]));
}"""


def _seen(desk: Desk, log: Path) -> dict[str, NDArray[np.float64]]:
    """Greys of every screen, in all sizes and colours."""
    page, painter = desk.open().page, desk.context.new_page()
    page.set_default_timeout(20000)
    page.set_input_files("input[type=file]", log)
    page.locator(".cards").wait_for()
    name = page.url.rpartition("/")[2]
    seen = {}
    for screen, drawn in DRAWN.items():
        page.goto(
            f"{page.url.partition('#')[0]}#/{screen}{'/' if screen else ''}{name if screen else ''}"
        )
        page.locator(drawn).first.wait_for()
        for size, (width, height) in SIZES.items():
            page.set_viewport_size({"width": width, "height": height})
            for theme in ("dark", "light"):
                coloured(page, theme)
                page.evaluate("scrollTo(0, 0)")
                page.wait_for_timeout(REST_MS)
                picture = base64.b64encode(page.screenshot()).decode()
                greys = painter.evaluate(GREYS, [picture, COLUMNS, ROWS])
                seen[f"{screen or 'logs'} {size} {theme}"] = np.array(greys, dtype=float)
    page.close()
    painter.close()
    return seen


def _alike(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Correlation of two pictures; 0 of one that is all the same."""
    a, b = one - one.mean(), other - other.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size else 0.0


def test_screens_look_as_they_did(desk: Desk, tmp_path: Path) -> None:
    seen = _seen(desk, SweepFlight(sweep_s=25.0, rate_hz=100.0).write(tmp_path))
    if os.environ.get("FLIGHTID_LOOKS") == "write":
        told: dict[str, Any] = {n: bytes(g.astype(np.uint8)).hex() for n, g in seen.items()}
        KEPT.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    before = {
        name: np.frombuffer(bytes.fromhex(told), dtype=np.uint8).astype(float)
        for name, told in json.loads(KEPT.read_text(encoding="utf-8")).items()
    }
    assert seen.keys() == before.keys()
    unlike = {name: _alike(greys, before[name]) for name, greys in seen.items()}
    assert {name: value for name, value in unlike.items() if value < ALIKE} == {}
    # A page that is light where it was dark has the same shapes turned over, or another mean.
    assert [n for n, g in seen.items() if abs(g.mean() - before[n].mean()) > 20.0] == []
    # And each is nearer to its own picture than to that of any other screen of its size and colour.
    for name, greys in seen.items():
        _, *kind = name.split()
        rivals = [n for n in before if n != name and n.split()[1:] == kind]
        assert unlike[name] > max(_alike(greys, before[n]) for n in rivals), name
