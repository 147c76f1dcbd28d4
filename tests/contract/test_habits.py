"""Habits that reviews forget: no prints, no open ends, no panics, no catch-all names."""

from __future__ import annotations

import ast
import re

import pytest

from tests.contract.source import PACKAGE, ROOT, nodes, python_files, rust_files, stage, tree

FORBIDDEN_STEMS = {"utils", "util", "helpers", "common", "misc", "base", "core"}
OPEN_ENDS = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b|todo!\(|unimplemented!\(|NotImplementedError")
OPEN_WORDS = ("TODO", "FIXME", "XXX", "HACK", "todo!", "unimplemented!", "NotImplementedError")
SUSPECT = re.compile(r"\b(eval|exec|print)\s*\(|except\s*:")  # worth a look at the tree
COMPILED = re.compile(r"^from dataclasses import .*\bdataclass\b", re.MULTILINE)
ORDERED = {"models/narx/terms.py"}
"""Classes that compare as larger and smaller, which `flightid.frozen` leaves to the library."""
PANICS = re.compile(r"\.unwrap\(\)|\.expect\(|panic!\(|unreachable!\(")


def _open_ends(text: str) -> list[str]:
    if not any(word in text for word in OPEN_WORDS):
        return []  # the expression is slow
    return [
        f"{1 + text.count(chr(10), 0, match.start())}: open end {match[0]!r}"
        for match in OPEN_ENDS.finditer(text)
    ]


def _python_habits(module: ast.Module, *, may_print: bool) -> list[str]:
    forbidden = {"eval", "exec"} if may_print else {"eval", "exec", "print"}
    found = []
    for node in nodes(module):
        called = node.func if isinstance(node, ast.Call) else None
        if isinstance(called, ast.Name) and called.id in forbidden:
            found.append(f"{called.lineno}: calls {called.id}")
        if isinstance(node, ast.ExceptHandler) and node.type is None:
            found.append(f"{node.lineno}: bare except")
    return found


def _panics(text: str) -> list[str]:
    return [
        f"{number}: {match[0]} can panic"
        for number, line in enumerate(text.split("\n"), 1)
        if not line.strip().startswith("//")
        for match in PANICS.finditer(line)
    ]


def _code_in_comments(text: str) -> list[str]:
    """Fences of documentation that hold code; text and formulas are opened as such."""
    found, inside = [], False
    for number, line in enumerate(text.split("\n"), 1):
        fence = re.match(r"\s*//[/!]\s*```(\w*)", line)
        if fence and not inside and fence[1] != "text":
            found.append(f"{number}: code that no test would run")
        inside = inside != bool(fence)
    return found


def test_python_sources() -> None:
    offenders = []
    for path in python_files():
        text = path.read_text("utf-8")
        found = _open_ends(text)
        if SUSPECT.search(text):
            found += _python_habits(tree(path), may_print=stage(path) == "cli")
        if path.stem in FORBIDDEN_STEMS:
            found.append("a name that says nothing")
        if COMPILED.search(text) and str(path.relative_to(PACKAGE)) not in ORDERED | {"frozen.py"}:
            found.append(" takes a millisecond a class to load: take it from flightid.frozen")
        offenders += [f"{path.relative_to(PACKAGE)}:{line}" for line in found]
    assert not offenders, "\n".join(offenders)


def test_rust_sources_neither_panic_nor_leave_ends_open() -> None:
    offenders = []
    for path in rust_files():
        if "tests" in path.parts or "benches" in path.parts:
            continue
        text = path.read_text("utf-8").split("#[cfg(test)]")[0]
        found = [*_open_ends(text), *_panics(text)]
        offenders += [f"{path.relative_to(ROOT)}:{line}" for line in found]
    assert not offenders, "\n".join(offenders)


def test_rust_comments_hold_no_code_that_nobody_runs() -> None:
    offenders = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in rust_files()
        for line in _code_in_comments(path.read_text("utf-8"))
    ]
    assert not offenders, "\n".join(offenders)
    planted = "//! ```text\n//! a = b\n//! ```\n/// ```\n/// x();\n/// ```\nfn x() {}"
    assert _code_in_comments(planted) == ["4: code that no test would run"]


@pytest.mark.parametrize(
    ("planted", "said"),
    [
        ("print('x')", ["1: calls print"]),
        ("eval('x')", ["1: calls eval"]),
        ("exec('x')", ["1: calls exec"]),
        ("try:\n    x\nexcept:\n    pass", ["3: bare except"]),
        ("try:\n    x\nexcept KeyError:\n    pass", []),
    ],
)
def test_python_habits_can_fail(planted: str, said: list[str]) -> None:
    assert _python_habits(ast.parse(planted), may_print=False) == said
    assert SUSPECT.search(planted) or not said


def test_a_command_may_print() -> None:
    assert not _python_habits(ast.parse("print('x')"), may_print=True)


@pytest.mark.parametrize(
    "planted",
    [
        "# TODO: later",
        "# HACK",
        "# XXX",
        "// FIXME",
        "todo!()",
        "unimplemented!()",
        "NotImplementedError",
    ],
)
def test_open_ends_can_fail(planted: str) -> None:
    assert len(_open_ends(f"fine\n{planted}")) == 1


@pytest.mark.parametrize("planted", [".unwrap()", '.expect("x")', 'panic!("x")', "unreachable!()"])
def test_panics_can_fail(planted: str) -> None:
    assert len(_panics(f"let x = y{planted};\n// {planted}")) == 1
