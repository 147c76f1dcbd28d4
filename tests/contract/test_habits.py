"""Habits that reviews forget: no prints, no open ends, no panics, no catch-all names."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.contract.source import PACKAGE, ROOT, python_files, rust_files, stage, tree

FORBIDDEN_STEMS = {"utils", "util", "helpers", "common", "misc", "base", "core"}
OPEN_ENDS = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b|todo!\(|unimplemented!\(|NotImplementedError")


@pytest.mark.parametrize("path", python_files(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_python_source(path: Path) -> None:
    assert path.stem not in FORBIDDEN_STEMS
    assert not OPEN_ENDS.search(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in {"eval", "exec"}, f"line {node.lineno}"
            assert node.func.id != "print" or stage(path) == "cli", f"line {node.lineno}"
        if isinstance(node, ast.ExceptHandler):
            assert node.type is not None, f"line {node.lineno}: bare except"


@pytest.mark.parametrize("path", rust_files(), ids=lambda p: str(p.relative_to(ROOT)))
def test_rust_source_neither_panics_nor_leaves_ends_open(path: Path) -> None:
    if "tests" in path.parts or "benches" in path.parts:
        return
    text = path.read_text(encoding="utf-8").split("#[cfg(test)]")[0]
    assert not OPEN_ENDS.search(text)
    code = "\n".join(line for line in text.split("\n") if not line.strip().startswith("//"))
    found = re.findall(r"\.unwrap\(\)|\.expect\(|panic!\(|unreachable!\(", code)
    assert not found, f"{len(found)} places can panic: {sorted(set(found))}"
