"""Rust files and rooms import one way; a stem shared with Python means two halves of one thing."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.contract.source import PACKAGE, ROOT, python_files, rust_files, tree

CRATES = ("core", "logs", "python")
# Tests stand to the right of everything: what they use makes no circle.
TEST_MODULE = re.compile(
    r"#\[cfg\(test\)\]\s*(#\[path[^\]]*\]\s*)?(pub(\(crate\))? )?mod \w+ ?[;{]"
)
START = re.compile(r"\b(crate|super|self)::")
CHILD = re.compile(r"^(?:pub(?:\([a-z]+\))? )?mod (\w+);", re.MULTILINE)
ROOM_LINE = re.compile(r"^//! - `(\w+)`: ", re.MULTILINE)

Module = tuple[str, ...]


def _code(text: str) -> str:
    """Source without comments and without its tests."""
    bare = re.sub(r"//[^\n]*", "", text)
    tests = TEST_MODULE.search(bare)
    return bare[: tests.start()] if tests else bare


def _branches(text: str) -> list[str]:
    """`{a, b::{c, d}}` from its opening brace on: its items."""
    items, depth, item = [], 0, ""
    for letter in text:
        depth += (letter == "{") - (letter == "}")
        if depth == 0 or (letter == "," and depth == 1):
            items.append(item)
            item = ""
        elif not (letter == "{" and depth == 1):
            item += letter
        if depth == 0:
            break
    return [each.strip() for each in items if each.strip()]


def _paths(text: str) -> Iterator[Module]:
    """All paths that a path with branches stands for."""
    head = re.match(r"\w+(\s*::\s*\w+)*", text)
    if not head:
        return
    segments = tuple(re.split(r"\s*::\s*", head[0]))
    rest = text[head.end() :]
    if re.match(r"::\s*\{", rest):
        for branch in _branches(rest[rest.index("{") :]):
            for below in _paths(branch):
                yield segments + (() if below[0] == "self" else below)
    else:
        yield segments


def _absolute(path: Module, module: Module, *, is_folder: bool) -> Module:
    """A path from the crate's root; `super` in a file is its folder, in `mod.rs` the one above."""
    if path[0] == "crate":
        return path[1:]
    here = module
    for depth, segment in enumerate(path):
        if segment == "super":
            here = here[:-1]
        elif segment != "self":
            return here + path[depth:]
    return here if is_folder else module


def _module(path: Path, root: Path) -> Module:
    parts = path.relative_to(root).with_suffix("").parts
    return parts[:-1] if parts[-1] in {"mod", "lib"} else parts


def _graph(sources: Mapping[Module, str], folders: set[Module]) -> dict[Module, set[Module]]:
    """What each module uses of the others, those that a folder lists included."""
    graph: dict[Module, set[Module]] = {}
    for module, text in sources.items():
        code = _code(text)
        found = {(*module, child) for child in CHILD.findall(code)} if module in folders else set()
        for start in START.finditer(code):
            for path in _paths(code[start.start() :]):
                target = _absolute(path, module, is_folder=module in folders)
                while target and target not in sources:
                    target = target[:-1]
                found.add(target)
        graph[module] = found - {module}
    return graph


def _circle(graph: Mapping[Module, set[Module]]) -> list[str]:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return ["::".join(module) or "lib" for module in error.args[1]]
    return []


def _rooms(graph: Mapping[Module, set[Module]]) -> dict[Module, set[Module]]:
    """The same between first folders; a file beside `lib.rs` is a room of its own."""
    rooms: dict[Module, set[Module]] = {}
    for module, targets in graph.items():
        if module:
            below = {target[:1] for target in targets if target}
            rooms.setdefault(module[:1], set()).update(below - {module[:1]})
    return rooms


def _crate(name: str) -> dict[Module, set[Module]]:
    root = ROOT / "crates" / name / "src"
    files = [path for path in rust_files() if root in path.parents and "tests" not in path.parts]
    sources = {_module(path, root): path.read_text(encoding="utf-8") for path in files}
    folders = {_module(path, root) for path in files if path.stem in {"mod", "lib"}}
    return _graph(sources, folders)


@pytest.mark.parametrize("name", CRATES)
def test_no_circle_of_files(name: str) -> None:
    assert not _circle(_crate(name))


@pytest.mark.parametrize("name", CRATES)
def test_no_circle_of_rooms(name: str) -> None:
    assert not _circle(_rooms(_crate(name)))


def test_rooms_of_the_core_use_those_that_its_first_page_lists_before_them() -> None:
    page = (ROOT / "crates" / "core" / "src" / "lib.rs").read_text(encoding="utf-8")
    order = ["error", *ROOM_LINE.findall(page)]
    rooms = {room: targets for (room,), targets in _rooms(_crate("core")).items()}
    assert sorted(order) == sorted(rooms)
    upward = [
        f"{room} uses {target}"
        for room, targets in rooms.items()
        for (target,) in targets
        if order.index(target) >= order.index(room)
    ]
    assert not upward


def _head(path: Path) -> str:
    lines = path.read_text(encoding="utf-8").split("\n")
    return " ".join(line[3:].strip() for line in lines if line.startswith("//!"))


def test_a_stem_of_both_halves_is_one_thing() -> None:
    stems = {path.stem for path in python_files()}
    strangers = [
        f"{path.relative_to(ROOT)} does not name {path.stem}.py as its Python side"
        for path in rust_files()
        if path.stem in stems and "tests" not in path.parts
        if not re.search(rf"\b{path.stem}\.py\b", _head(path))
    ]
    assert not strangers


def test_files_that_one_half_names_of_the_other_exist() -> None:
    python = {f"/{path.relative_to(PACKAGE).as_posix()}" for path in python_files()}
    rust = {f"/{path.relative_to(ROOT).as_posix()}" for path in rust_files()}
    lost = []
    for path in rust_files():
        names = re.findall(r"[\w/]+\.py\b", _head(path))
        known = {name for name in names if any(each.endswith(f"/{name}") for each in python)}
        unknown = [name for name in names if name not in known and not (ROOT / name).exists()]
        lost += [f"{path.relative_to(ROOT)} names {name}" for name in unknown]
    for path in python_files():
        names = re.findall(r"`([\w/]+\.rs)`", ast.get_docstring(tree(path)) or "")
        unknown = [name for name in names if not any(each.endswith(f"/{name}") for each in rust)]
        lost += [f"{path.relative_to(ROOT)} names {name}" for name in unknown]
    assert not lost


def test_what_runs_in_the_widest_registers_is_inlined_there() -> None:
    """A closure that is not inlined into `widest` is compiled for the narrowest of all machines."""
    narrow = re.compile(r"\bwidest\(\s*(?:move )?\|")
    assert narrow.search("widest(|| work())"), "the rule can fail"
    for path in rust_files():
        assert not narrow.search(_code(path.read_text(encoding="utf-8"))), path


def test_the_rules_can_fail() -> None:
    sources = {
        (): "pub mod a;\npub mod b;\n",
        ("a",): "pub mod c;\npub mod d;\n",
        ("a", "c"): "use super::d::{E, f};\n#[cfg(test)]\nmod tests { use crate::b; }",
        ("a", "d"): "// crate::a::c\npub struct E;",
        ("b",): "use crate::a::{c::{C, self}, d};",
    }
    folders: set[Module] = {(), ("a",)}
    graph = _graph(sources, folders)
    assert graph["a", "c"] == {("a", "d")}
    assert graph["b",] == {("a", "c"), ("a", "d")}
    assert not _circle(graph)
    back = _graph({**sources, ("a", "d"): "use crate::a::c::C;"}, folders)
    assert set(_circle(back)) == {"a::c", "a::d"}
    parent = _graph({**sources, ("a", "d"): "use super::Thing;"}, folders)
    assert set(_circle(parent)) == {"a", "a::d"}
    rooms = _graph({**sources, ("a", "d"): "fn f() { crate::b::g() }"}, folders)
    assert set(_circle(_rooms(rooms))) == {"a", "b"}
