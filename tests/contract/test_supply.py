"""What is shipped from others: listed whole, by what is locked, under licences that are allowed."""

from __future__ import annotations

import json
import re
import shutil
import tomllib

import pytest
from tools import sbom

from tests.contract.source import ROOT

LISTED = json.loads(sbom.PLACE.read_text("utf-8"))
ALLOWED = tomllib.loads((ROOT / "deny.toml").read_text("utf-8"))["licenses"]["allow"]


@pytest.mark.skipif(shutil.which("cargo") is None, reason="asks cargo for the crates")
def test_the_bill_of_materials_is_that_of_the_locks() -> None:
    assert sbom.PLACE.read_text("utf-8") == sbom.text(), "run tools/sbom.py --write"


def test_the_bill_names_no_folder_and_each_package_with_its_checksum() -> None:
    for each in LISTED["components"]:
        own = each["name"].startswith("flightid") or each["name"] == "plotly.js"
        assert own != ("hashes" in each), each["name"]
        assert re.fullmatch(r"pkg:(cargo|npm)/[\w.-]+@[\w.+-]+", each["purl"]), each["purl"]
    refs = [each["ref"] for each in LISTED["dependencies"]]
    needed = {one for each in LISTED["dependencies"] for one in each["dependsOn"]}
    # All but the wheel itself is there because something needs it.
    assert needed == set(refs[1:]) == {each["bom-ref"] for each in LISTED["components"]}


def test_the_page_of_licences_tells_the_versions_of_the_bill() -> None:
    page = (ROOT / "THIRD_PARTY.md").read_text("utf-8")
    crates = page[page.index("## Crates") : page.index("## Packages")]
    versions = {each["name"]: each["version"] for each in LISTED["components"]}
    rows = dict(re.findall(r"^\| ([\w.-]+) \| (\d[\w.]*) \|", crates, re.MULTILINE))
    # The bill holds crates of other systems beside them.
    assert len(rows) > 20
    assert rows.items() <= versions.items()
    words = {"svelte": "Svelte", "uplot": "uPlot", "three": "three.js"}
    for name in ("fflate", "svelte", "three", "uplot", "plotly.js"):
        assert f"{words.get(name, name)} {versions[name]} (MIT" in " ".join(page.split())


def test_licences_of_what_is_built_with_are_allowed_too() -> None:
    """As `cargo deny` reads them: each part of an AND, one of an OR."""
    for each in LISTED["components"]:
        (told,) = (licence["expression"] for licence in each["licenses"])
        for part in told.split(" AND "):
            assert set(part.strip("()").split(" OR ")) & {*ALLOWED}, (each["name"], told)


def test_crates_that_no_registry_takes_may_name_each_other_by_folder() -> None:
    """`cargo deny` refuses paths without versions in crates that may be published."""
    for path in ROOT.glob("crates/*/Cargo.toml"):
        assert tomllib.loads(path.read_text("utf-8"))["package"]["publish"] is False, path


def test_a_wheel_holds_the_bill_in_place_of_one_with_folders() -> None:
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["maturin"]
    assert tool["sbom"] == {"rust": False, "include": [str(sbom.PLACE.relative_to(ROOT))]}
