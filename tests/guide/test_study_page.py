"""The page of the study file: its examples are TOML, and no key of a study is missing."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```toml\n(.*?)^```", re.MULTILINE | re.DOTALL)
READERS = {"reader", "entry", "root", "inner"}


def _blocks() -> list[tuple[str, str]]:
    return [
        (f"{page.name} {number}", text)
        for page in PAGES
        for number, text in enumerate(BLOCK.findall(page.read_text(encoding="utf-8")))
    ]


@pytest.mark.parametrize(("place", "text"), _blocks(), ids=[place for place, _ in _blocks()])
def test_toml_of_a_page_can_be_read(place: str, text: str) -> None:
    assert tomllib.loads(text), place


def _keys_of_a_study() -> set[str]:
    """Keys that the readers of a study ask for by name."""
    found = set()
    for path in (ROOT / "src" / "flightid" / "study").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            if not (isinstance(node.func.value, ast.Name) and node.func.value.id in READERS):
                continue
            place = 1 if node.func.attr == "maybe" else 0
            key = node.args[place] if len(node.args) > place else None
            if node.func.attr != "error" and isinstance(key, ast.Constant):
                found.add(str(key.value))
    return found


def test_every_key_of_a_study_is_on_the_page() -> None:
    keys = _keys_of_a_study()
    assert len(keys) > 60
    words = set(re.findall(r"\w+", (ROOT / "docs" / "study.md").read_text(encoding="utf-8")))
    assert sorted(keys - words) == [], "tell these keys in docs/study.md"
