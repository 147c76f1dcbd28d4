"""The import rule of ARCHITECTURE.md, read from the syntax trees."""

from __future__ import annotations

from pathlib import Path

from tests.contract.source import PACKAGE, imported_modules, python_files, stage

BASE = {
    "_native",
    "conventions",
    "errors",
    "files",
    "findings",
    "options",
    "progress",
    "result",
    "table",
    "units",
    "version",
}
# Left to right: a room may import base files and the rooms before it.
ORDER = [
    "excitation",
    "record",
    "uncertainty",
    "logs",
    "conditioning",
    "responses",
    "inspection",
    "models",
    "simulation",
    "evidence",
    "identification",
    "validation",
    "dynamics",
    "control",
    "vehicles",
    "export",
]
# Result types only, and nobody but the chain's ends imports them.
SHOW = {"plot", "report"}
ENDS = {"study", "cli", "app", "__init__", "__main__"}
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
    if source == "report":
        return target in ORDER or target == "plot"
    if source == "plot":
        return target in ORDER
    return source in ORDER and target in ORDER[: ORDER.index(source)]


def _broken(source: str, targets: set[str]) -> list[str]:
    return sorted(target for target in targets if not _may_import(source, target))


def test_every_room_has_its_place() -> None:
    known = {*BASE, *ORDER, *SHOW, *ENDS}
    assert {stage(path) for path in python_files()} <= known


def test_a_room_imports_only_what_lies_before_it() -> None:
    broken = {
        str(path.relative_to(PACKAGE)): found
        for path in python_files()
        if (found := _broken(stage(path), _targets(path)))
    }
    assert not broken


def test_only_plot_and_report_import_a_plotting_library() -> None:
    found = [
        str(path.relative_to(PACKAGE))
        for path in python_files()
        if stage(path) not in SHOW
        and PLOTTING & {module.split(".")[0] for module in imported_modules(path)}
    ]
    assert not found


def test_the_rule_can_fail() -> None:
    assert _broken("record", {"responses", "errors"}) == ["responses"]
    assert _broken("responses", {"plot", "record"}) == ["plot"]
    assert _broken("units", {"record"}) == ["record"]
    assert _broken("simulation", {"identification"}) == ["identification"]
    assert not _broken("responses", {"record"})
