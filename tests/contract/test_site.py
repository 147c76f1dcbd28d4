"""The documentation site: every public name has its place, every picture and page is there."""

from __future__ import annotations

import re
import subprocess
import sys
import types
from pathlib import Path

import pytest
import yaml

import flightid
from tests.contract.source import ROOT

sys.path.insert(0, str(ROOT / "tools"))
from gallery_pictures import COMMANDS, SHOTS
from pictures import MAXIMUM_BYTES
from reference_groups import GROUPS
from site_pages import api_page, shown_texts, turned

DOCS = ROOT / "docs"


class _Loader(yaml.SafeLoader):
    """Reads the tags of mkdocs.yml as plain values."""


_Loader.add_constructor("!ENV", lambda loader, node: loader.construct_sequence(node))


def _pages_in_the_order_of_the_navigation() -> list[str]:
    found: list[str] = []

    def walk(node: object) -> None:
        if isinstance(node, str):
            found.append(node)
        elif isinstance(node, list):
            for item in node:
                walk(item)
        elif isinstance(node, dict):
            for item in node.values():
                walk(item)

    settings = yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), Loader=_Loader)
    assert settings["strict"] is True
    assert settings["theme"]["font"] is False
    walk(settings["nav"])
    return found


def test_every_public_name_stands_in_one_group() -> None:
    listed = [name for group in GROUPS.values() for name in group.names]
    public = {name for name in flightid.__all__ if not name.startswith("__")}
    where = "put it into, or take it out of, tools/reference_groups.py"
    assert sorted(public - set(listed)) == [], where
    assert sorted(set(listed) - public) == [], where
    assert len(listed) == len(set(listed)), where


@pytest.mark.parametrize("key", GROUPS)
def test_a_group_becomes_a_page_with_all_its_names(key: str) -> None:
    group = GROUPS[key]
    page = api_page(group)
    assert (DOCS / group.guide).is_file()
    for name in group.names:
        assert f"\n::: flightid.{name}\n" in page or f'id="flightid.{name}"' in page
        item = getattr(flightid, name)
        if isinstance(item, types.ModuleType):
            assert all(f'"{part}"' in page for part in item.__all__), name


def test_the_navigation_has_every_page_once() -> None:
    listed = _pages_in_the_order_of_the_navigation()
    guides = {path.name for path in DOCS.glob("*.md")}
    made = {f"api/{key}.md" for key in GROUPS} | set(shown_texts()) | {"commands.md"}
    assert sorted(listed) == sorted(guides | made)
    order = [f"api/{key}.md" for key in ("data", "inspect", "responses", "identify", "check")]
    assert [page for page in listed if page in order] == order


def test_links_and_pictures_of_texts_are_there_on_a_disk_too() -> None:
    texts = [*ROOT.glob("*.md"), *DOCS.glob("*.md"), *ROOT.glob("examples/*/README.md")]
    lost = [
        f"{text.relative_to(ROOT)}: {target}"
        for text in texts
        for target in re.findall(r"\]\((?!https?://|#)([^)#\s]+)", text.read_text("utf-8"))
        if not (text.parent / target).exists()
    ]
    assert not lost


def test_links_turn_into_links_between_pages() -> None:
    texts = {"examples/r50.md": "examples/r50/README.md", "conventions.md": "CONVENTIONS.md"}
    assert turned("[a](../examples/r50/README.md)", "gallery.md", texts) == "[a](examples/r50.md)"
    assert turned("[a](study.md#gains)", "tasks.md", texts) == "[a](study.md#gains)"
    assert turned("[a](docs/study.md)", "conventions.md", texts) == "[a](study.md)"
    from_example = turned("[a](../../docs/study.md)", "examples/r50.md", texts)
    assert from_example == "[a](../study.md)"
    assert turned("[a](../ah64/flights.py)", "examples/r50.md", texts) == "a"
    assert turned("[a](https://x.org/y)", "tasks.md", texts) == "[a](https://x.org/y)"


def test_the_gallery_can_be_drawn_again() -> None:
    for example, commands in COMMANDS.items():
        folder = ROOT / "examples" / example
        for command in commands:
            files = [word for word in command.split() if word.endswith((".py", ".toml"))]
            assert files, command
            assert all((folder / file).is_file() for file in files), f"{example}: {command}"
    assert {shot.example for shot in SHOTS} == set(COMMANDS)
    gallery = (DOCS / "gallery.md").read_text(encoding="utf-8")
    for shot in SHOTS:
        assert f"pictures/{shot.picture}" in gallery
        assert 0 < (DOCS / "pictures" / shot.picture).stat().st_size <= MAXIMUM_BYTES


def test_every_screen_of_the_page_has_its_picture() -> None:
    """`tools/app_pictures.py` takes them."""
    listed = (ROOT / "app" / "src" / "lib" / "screens.ts").read_text(encoding="utf-8")
    names = re.findall(r'\{ name: "(\w+)", title:', listed)
    text = (DOCS / "app.md").read_text(encoding="utf-8")
    assert len(names) > 10
    for name in names:
        assert f"](pictures/app-{name}.png)" in text
        assert 0 < (DOCS / "pictures" / f"app-{name}.png").stat().st_size <= MAXIMUM_BYTES


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_loads_nothing_from_afar(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]
    pages = {path: path.read_text(encoding="utf-8") for path in tmp_path.rglob("*.html")}
    for path, text in pages.items():
        loaded = re.findall(r"<(?:script|img|iframe)[^>]*\ssrc=\"?(https?:|//)", text)
        styles = re.findall(r"<link[^>]*stylesheet[^>]*href=\"?(https?:|//)", text)
        assert not loaded + styles, path.name
    for key, group in GROUPS.items():
        page = pages[tmp_path / "api" / f"{key}.html"]
        for name in group.names:
            assert f'id="flightid.{name}"' in page, name
        headed = set(re.findall(r'doc-module-name">(?:flightid\.)?(\w+)', page))
        modules = {n for n in group.names if isinstance(getattr(flightid, n), types.ModuleType)}
        assert headed == modules, "a module was taken for the verb of its name"
        assert "Examples:" in page, "the reader did not know the section"
        assert "&gt;&gt;&gt;" in page
    assert 'class="output highlight"' in pages[tmp_path / "start.html"], "what examples print"
