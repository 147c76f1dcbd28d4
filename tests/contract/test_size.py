"""Small files, small functions; an exception needs a written reason here."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.contract.source import PACKAGE, ROOT, python_files, rust_files, tree

MAXIMUM_FILE = 400
MAXIMUM_FUNCTION = 80
# Path below the repository -> reason.
LONG_FILES: dict[str, str] = {}
LONG_FUNCTIONS: dict[str, str] = {}

ALL_FILES = [*python_files(), *rust_files()]


def _name(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", ALL_FILES, ids=_name)
def test_file_is_small(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").count("\n")
    assert lines <= MAXIMUM_FILE or LONG_FILES.get(_name(path)), f"{lines} lines"


@pytest.mark.parametrize("path", python_files(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_python_functions_are_small(path: Path) -> None:
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            document = node.body[0]
            has_doc = isinstance(document, ast.Expr) and isinstance(document.value, ast.Constant)
            skipped = (document.end_lineno or 0) - document.lineno + 1 if has_doc else 0
            length = (node.end_lineno or 0) - node.lineno + 1 - skipped
            key = f"{_name(path)}:{node.name}"
            assert length <= MAXIMUM_FUNCTION or LONG_FUNCTIONS.get(key), f"{key}: {length} lines"


@pytest.mark.parametrize("path", rust_files(), ids=_name)
def test_rust_functions_are_small(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").split("\n")
    for number, line in enumerate(lines):
        start = re.match(r"^(\s*)(pub(\([a-z]+\))? )?(const )?fn (\w+)", line)
        if not start:
            continue
        head = next(i for i in range(number, len(lines)) if lines[i].rstrip()[-1:] in "{};")
        if lines[head].rstrip().endswith(";"):
            continue  # a trait's declaration without a body
        closing = start.group(1) + "}"
        end = next((i for i in range(number, len(lines)) if lines[i] == closing), number)
        key = f"{_name(path)}:{start.group(5)}"
        length = end - number + 1
        assert length <= MAXIMUM_FUNCTION or LONG_FUNCTIONS.get(key), f"{key}: {length} lines"


def test_reasons_are_not_stale() -> None:
    for name in LONG_FILES:
        lines = (ROOT / name).read_text(encoding="utf-8").count("\n")
        assert lines > MAXIMUM_FILE, f"{name} is short now: remove its reason"
