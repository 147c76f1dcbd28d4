"""Small files, small functions; an exception needs a written reason here."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.contract.source import ROOT, nodes, python_files, rust_files, tree

MAXIMUM_FILE = 400
MAXIMUM_FUNCTION = 80
# Path below the repository -> reason.
LONG_FILES: dict[str, str] = {}
# Path below the repository and name, "src/flightid/x.py:verb" -> reason.
LONG_FUNCTIONS: dict[str, str] = {}
RUST_FUNCTION = re.compile(r"^(\s*)(pub(\([a-z]+\))? )?(const )?fn (\w+)")


def _name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def _lines(text: str) -> int:
    return text.count("\n")


def _python_functions(module: ast.Module) -> Iterator[tuple[str, int]]:
    """Name and lines of each function, its docstring not counted."""
    for node in nodes(module):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            document = node.body[0]
            has_doc = isinstance(document, ast.Expr) and isinstance(document.value, ast.Constant)
            skipped = (document.end_lineno or 0) - document.lineno + 1 if has_doc else 0
            yield node.name, (node.end_lineno or 0) - node.lineno + 1 - skipped


def _rust_functions(text: str) -> Iterator[tuple[str, int]]:
    """Name and lines of each function with a body, as rustfmt lays them out."""
    lines = text.split("\n")
    for number, line in enumerate(lines):
        start = RUST_FUNCTION.match(line)
        if not start:
            continue
        head = next(i for i in range(number, len(lines)) if lines[i].rstrip()[-1:] in "{};")
        if lines[head].rstrip().endswith(";"):
            continue  # a trait's declaration without a body
        closing = start.group(1) + "}"
        end = next((i for i in range(number, len(lines)) if lines[i] == closing), number)
        yield start.group(5), end - number + 1


def _too_long(name: str, functions: Iterator[tuple[str, int]]) -> list[str]:
    return [
        f"{name}:{function}: {length} lines, at most {MAXIMUM_FUNCTION}"
        for function, length in functions
        if length > MAXIMUM_FUNCTION and f"{name}:{function}" not in LONG_FUNCTIONS
    ]


def test_files_are_small() -> None:
    found = {_name(path): _lines(path.read_text("utf-8")) for path in _both_halves()}
    long = {name: lines for name, lines in found.items() if lines > MAXIMUM_FILE}
    offenders = [
        f"{name}: {lines} lines, at most {MAXIMUM_FILE}"
        for name, lines in long.items()
        if name not in LONG_FILES
    ]
    assert not offenders, "\n".join(offenders)
    assert long.keys() == LONG_FILES.keys(), "remove the reasons of files that are short now"


def _both_halves() -> tuple[Path, ...]:
    return (*python_files(), *rust_files())


def test_functions_are_small() -> None:
    offenders = [
        *(line for p in python_files() for line in _too_long(_name(p), _python_functions(tree(p)))),
        *(
            line
            for p in rust_files()
            for line in _too_long(_name(p), _rust_functions(p.read_text("utf-8")))
        ),
    ]
    assert not offenders, "\n".join(offenders)


def test_the_walk_reaches_both_halves() -> None:
    assert len(python_files()) > 200
    assert len(rust_files()) > 100


def test_the_rule_can_fail() -> None:
    assert _lines("x\n" * 401) > MAXIMUM_FILE
    body = MAXIMUM_FUNCTION - 1
    for extra in (0, 1):
        lines = body + extra
        python = ast.parse('def verb():\n    """Text.\n\n    More."""\n' + "    x = 1\n" * lines)
        rust = "    pub(crate) fn verb(\n    ) {\n" + "        x();\n" * (lines - 2) + "    }\n"
        declared = "fn declared();\n"
        for functions in (_python_functions(python), _rust_functions(declared + rust)):
            expected = ["a:verb: 81 lines, at most 80"] if extra else []
            assert _too_long("a", functions) == expected
