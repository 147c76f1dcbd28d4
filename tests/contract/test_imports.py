"""The import rule of ARCHITECTURE.md, read from the syntax trees."""

from __future__ import annotations

from pathlib import Path

from tests.contract.source import PACKAGE, imported_modules, imports, python_files, stage

BASE = {
    "_native",
    "common_units",
    "conventions",
    "dimensions",
    "errors",
    "extras",
    "files",
    "findings",
    "formula",
    "frozen",
    "option_forms",
    "options",
    "progress",
    "reading",
    "recursive_filter",
    "result",
    "scalar_search",
    "surface",
    "table",
    "threads",
    "units",
    "version",
    "wrapping",
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
    "review",
    "planning",
    "vehicles",
    "export",
]
# Result types only, and nobody but the chain's ends imports them.
SHOW = {"plot", "report"}
ENDS = {"study", "fleet", "cli", "app", "__init__", "__main__"}
# Of the ends, what each leaves alone.
BEHIND = {"study": {"fleet", "app", "cli"}, "fleet": {"app", "cli"}, "app": {"cli"}}
PLOTTING = {"plotly", "matplotlib"}


def _targets(path: Path) -> set[str]:
    found = set()
    for module in imported_modules(path):
        parts = module.split(".")
        if parts[0] == "flightid" and len(parts) > 1:
            found.add(parts[1])
    return found


def _may_import(source: str, target: str) -> bool:
    if target in BASE or source == target:
        return True
    if source in ENDS:
        return target not in BEHIND.get(source, set())
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
    assert _broken("study", {"fleet", "record"}) == ["fleet"]
    assert not _broken("fleet", {"study", "report"})


def _imports(path: Path, known: set[str]) -> set[str]:
    """Modules of the package that a file imports, for types too, by dotted name."""
    named = [(module, f"{module}.{name}") for module, name in imports(path)]
    return {inner if inner in known else module for module, inner in named} & known


def _dotted(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(("flightid", *parts)).removesuffix(".__init__")


def _circles(arrows: dict[str, set[str]]) -> list[str]:
    """Nodes that stay when those are taken away again and again that nothing leads to or from."""
    left = {node: targets & set(arrows) for node, targets in arrows.items()}
    while True:
        reached = set().union(*left.values()) if left else set()
        ends = {node for node, targets in left.items() if not targets or node not in reached}
        if not ends:
            return sorted(left)
        left = {node: targets - ends for node, targets in left.items() if node not in ends}


def _folder(name: str) -> str:
    """The folder of a file inside a room; a file that lies in the room itself stands alone."""
    parts = name.split(".")
    return ".".join(parts[:3]) if len(parts) > 3 else name


def test_no_circle_runs_through_files_or_folders() -> None:
    # The package's own list of names imports everything and is imported for the native half.
    known = {_dotted(path) for path in python_files()}
    arrows = {_dotted(path): _imports(path, known) for path in python_files()}
    del arrows["flightid"]
    files = {name: targets & set(arrows) - {name} for name, targets in arrows.items()}
    assert not _circles(files)
    folders: dict[str, set[str]] = {}
    lists = {_dotted(path) for path in python_files() if path.name == "__init__.py"}
    for name in set(files) - lists:
        inner = {_folder(target) for target in files[name] - lists}
        folders.setdefault(_folder(name), set()).update(inner - {_folder(name)})
    assert not _circles(folders)


def test_a_circle_is_seen() -> None:
    assert _circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == ["a", "b", "c"]
    assert not _circles({"a": {"b"}, "b": {"c"}, "c": set()})
