"""Classes of results do not change, and compare as objects where they hold arrays.

`==` of arrays has no truth value, and they have no hash.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Set as AbstractSet

from tests.contract.source import PACKAGE, nodes, python_files, tree

PACKAGES = ("logs", "inspection", "evidence", "uncertainty", "control/tuning")
ARRAY = re.compile(r"^(?!Callable).*\b(?:Array|NDArray|Complex)\b")


def _told(made: ast.ClassDef) -> list[str]:
    """How the dataclass is made, if it is one."""
    return [ast.unparse(each) for each in made.decorator_list if "dataclass" in ast.unparse(each)]


def _holds_arrays(made: ast.ClassDef, apart: AbstractSet[str] = frozenset()) -> bool:
    """Whether it holds arrays, or what is told apart by identity for them."""
    kinds = [ast.unparse(each.annotation) for each in made.body if isinstance(each, ast.AnnAssign)]
    return any(ARRAY.search(each) or apart & set(re.findall(r"\w+", each)) for each in kinds)


def _is_compared(made: ast.ClassDef, apart: AbstractSet[str] = frozenset()) -> bool:
    """Whether it is a dataclass whose arrays `==` would compare."""
    return any("eq=False" not in each for each in _told(made)) and _holds_arrays(made, apart)


def _may_change(made: ast.ClassDef) -> bool:
    """Whether it is a dataclass that is not frozen."""
    return any("frozen=True" not in each for each in _told(made))


def _says_too_much(made: ast.ClassDef, apart: AbstractSet[str] = frozenset()) -> bool:
    """Whether it turns off a method that it writes itself, or `==` of what has a truth value."""
    written = {each.name for each in made.body if isinstance(each, ast.FunctionDef)}
    own = "__repr__" in written and any("repr=False" in each for each in _told(made))
    return own or (
        any("eq=False" in each for each in _told(made)) and not _holds_arrays(made, apart)
    )


def test_classes_that_hold_arrays_are_told_apart_by_identity() -> None:
    every = [
        (path.relative_to(PACKAGE).as_posix(), node)
        for path in python_files()
        for node in nodes(tree(path))
        if isinstance(node, ast.ClassDef)
    ]
    apart = {node.name for _, node in every if any("eq=False" in each for each in _told(node))}
    made = [(f"{path}: {node.name}", node) for path, node in every if path.startswith(PACKAGES)]
    assert not [name for name, node in made if _is_compared(node, apart)], "(frozen=True, eq=False)"
    assert not [name for name, node in made if _may_change(node)], "(frozen=True)"
    assert not [name for name, node in made if _says_too_much(node, apart)], "leave it out"


def test_a_class_that_changes_or_compares_arrays_is_found() -> None:
    def planted(words: str) -> ast.ClassDef:
        (made,) = ast.parse(words).body
        assert isinstance(made, ast.ClassDef)
        return made

    arrays = planted("@dataclass(frozen=True)\nclass A:\n    x: Array | None = None")
    assert _is_compared(arrays)
    assert not _may_change(arrays)
    assert _may_change(planted("@dataclass(frozen=False)\nclass A:\n    x: int"))
    member = planted("@dataclass(frozen=True)\nclass B:\n    parts: tuple[A, ...]")
    assert _is_compared(member, {"A"})
    assert not _is_compared(member)
    silent = planted("@dataclass(frozen=True, eq=False)\nclass B:\n    part: A")
    assert (_says_too_much(silent), _says_too_much(silent, {"A"})) == (True, False)
    own = "@dataclass(frozen=True, repr=False)\nclass B:\n    part: A\n    def {}(self): ..."
    assert _says_too_much(planted(own.format("__repr__")))
    assert not _says_too_much(planted(own.format("told")))
