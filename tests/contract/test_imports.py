"""The import rule of ARCHITECTURE.md, read from the syntax trees."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.contract.source import PACKAGE, imported_modules, python_files, stage

BASE = {
    "_native",
    "conventions",
    "errors",
    "files",
    "findings",
    "progress",
    "table",
    "units",
    "version",
}
# Left to right: a stage may import base files and the stages before it.
ORDER = [
    "excitation",
    "record",
    "logs",
    "conditioning",
    "responses",
    "inspection",
    "models",
    "identification",
    "inference",
    "validation",
    "dynamics",
    "control",
    "simulation",
]
# Result types only, and nobody but the chain's ends imports them.
SHOW = {"plot", "report"}
ENDS = {"study", "cli", "app", "__init__", "__main__"}
# Inference serves fits with statistics, and simulation serves verification and loops: both are
# stages that name a later one's verbs nowhere, so these arrows keep the graph without circles.
ALLOWED = {
    ("identification", "inference"),
    ("validation", "simulation"),
    ("control", "simulation"),
    ("dynamics", "simulation"),
}
PLOTTING = {"plotly", "matplotlib"}


def _targets(path: Path) -> set[str]:
    found = set()
    for module in imported_modules(path):
        parts = module.split(".")
        if parts[0] == "flightid" and len(parts) > 1:
            found.add(parts[1])
    return found


def _may_import(source: str, target: str) -> bool:
    if target in BASE or source == target or source in ENDS:
        return True
    if source in BASE:
        return False
    if source == "report":
        return target in ORDER or target == "plot"
    if source == "plot":
        return target in ORDER
    if target in SHOW or target in ENDS:
        return False
    if (source, target) in ALLOWED:
        return True
    return source in ORDER and target in ORDER and ORDER.index(target) < ORDER.index(source)


@pytest.mark.parametrize("path", python_files(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_stage_imports_only_what_lies_before_it(path: Path) -> None:
    source = stage(path)
    if source not in ENDS:
        assert source in BASE or source in ORDER or source in SHOW, f"{source} is in no stage"
    broken = {target for target in _targets(path) if not _may_import(source, target)}
    assert not broken, f"{source} may not import {sorted(broken)}"


@pytest.mark.parametrize("path", python_files(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_only_plot_and_report_import_a_plotting_library(path: Path) -> None:
    libraries = {module.split(".")[0] for module in imported_modules(path)} & PLOTTING
    assert not libraries or stage(path) in SHOW


def test_the_rule_can_fail() -> None:
    assert not _may_import("record", "responses")
    assert not _may_import("responses", "plot")
    assert not _may_import("units", "record")
    assert _may_import("responses", "record")
