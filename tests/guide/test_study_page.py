"""The page of the study file: its examples are TOML, and no key of a study is missing."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from tools.options_page import FLEET, STUDY

from flightid.options import options_of

ROOT = Path(__file__).parent.parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```toml\n(.*?)^```", re.MULTILINE | re.DOTALL)


def _blocks() -> list[tuple[str, str]]:
    return [
        (f"{page.name} {number}", text)
        for page in PAGES
        for number, text in enumerate(BLOCK.findall(page.read_text(encoding="utf-8")))
    ]


@pytest.mark.parametrize(("place", "text"), _blocks(), ids=[place for place, _ in _blocks()])
def test_toml_of_a_page_can_be_read(place: str, text: str) -> None:
    assert tomllib.loads(text), place


def test_every_key_of_a_study_is_on_the_page() -> None:
    """Those of simulated flights and of positions stand on the page of options alone."""
    shown = [
        table
        for name, table in STUDY.items()
        if not name.startswith(("[flight.", "[[flight.", "Pos"))
    ]
    keys = {each.name for table in shown for each in options_of(table)}
    assert len(keys) > 100
    words = set(re.findall(r"\w+", (ROOT / "docs" / "study.md").read_text(encoding="utf-8")))
    assert sorted(keys - words) == [], "tell these keys in docs/study.md"


def test_every_key_of_a_fleet_file_is_on_its_page() -> None:
    keys = {each.name for table in FLEET.values() for each in options_of(table)}
    assert len(keys) > 20
    words = set(re.findall(r"\w+", (ROOT / "docs" / "fleet.md").read_text(encoding="utf-8")))
    assert sorted(keys - words) == [], "tell these keys in docs/fleet.md"
