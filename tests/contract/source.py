"""Walks over the package's sources, shared by the contract tests."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
PACKAGE = ROOT / "src" / "flightid"


@cache
def python_files() -> tuple[Path, ...]:
    return tuple(sorted(PACKAGE.rglob("*.py")))


@cache
def rust_files() -> tuple[Path, ...]:
    return tuple(
        sorted(path for path in (ROOT / "crates").rglob("*.rs") if "target" not in path.parts)
    )


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


@cache
def nodes(module: ast.Module) -> tuple[ast.AST, ...]:
    """Every node of a tree, walked once for all that look at it."""
    return tuple(ast.walk(module))


def stage(path: Path) -> str:
    """First folder below the package, or the stem of a base file."""
    parts = path.relative_to(PACKAGE).parts
    return parts[0] if len(parts) > 1 else path.stem


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Every statement at any depth; an import is one, so expressions need no look."""
    for statement in body:
        yield statement
        for field in ("body", "orelse", "finalbody", "handlers", "cases"):
            yield from _statements(getattr(statement, field, []))


@cache
def imports(path: Path) -> tuple[tuple[str, str | None], ...]:
    """Module and name of everything that a file imports; no name where it is a whole module."""
    found: list[tuple[str, str | None]] = []
    for node in _statements(tree(path).body):
        if isinstance(node, ast.Import):
            found += [(alias.name, None) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found += [(node.module, alias.name) for alias in node.names]
    return tuple(found)


def imported_modules(path: Path) -> set[str]:
    """Every absolute module name that a file imports, at any depth."""
    found = {module for module, _ in imports(path)}
    return found | {f"{module}.{name}" for module, name in imports(path) if module == "flightid"}
