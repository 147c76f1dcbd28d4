"""The version stands in Cargo.toml; everything else takes it from there or agrees."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import flightid
from flightid.version import VERSION
from tests.contract.source import ROOT

CRATES = ("core", "logs", "python")


def _toml(path: Path) -> dict[str, dict[str, dict[str, object]]]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def _stated() -> object:
    return _toml(ROOT / "Cargo.toml")["workspace"]["package"]["version"]


def test_the_installed_package_has_the_version_of_cargo() -> None:
    assert _stated() == VERSION == flightid.__version__


@pytest.mark.parametrize("crate", CRATES)
def test_crates_take_it_from_the_workspace(crate: str) -> None:
    package = _toml(ROOT / "crates" / crate / "Cargo.toml")["package"]
    assert package["version"] == {"workspace": True}


def test_the_python_project_takes_it_from_cargo() -> None:
    project = _toml(ROOT / "pyproject.toml")["project"]
    assert "version" not in project
    assert project["dynamic"] == ["version"]


def test_the_citation_states_none() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert "version" not in citation


def test_the_changelog_dates_it_and_keeps_lines_short() -> None:
    lines = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    heads = [line for line in lines if line.startswith("## ")]
    assert heads[0] == "## [Unreleased]"
    for head in heads[1:]:
        assert re.fullmatch(r"## \[\d+\.\d+\.\d+\] - \d{4}-\d{2}-\d{2}", head), head
    assert heads[1].startswith(f"## [{VERSION}] ")
    long = [line for line in lines if len(line) > 110]
    assert not long, "one short line an entry"
