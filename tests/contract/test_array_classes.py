"""Classes of results do not change, and compare as objects where they hold arrays.

`==` of arrays has no truth value, and they have no hash.
"""

from __future__ import annotations

import ast
import re

from tests.contract.source import PACKAGE, nodes, python_files, tree

PACKAGES = ("logs", "inspection", "evidence", "uncertainty", "control/tuning")
ARRAY = re.compile(r"^(?!Callable).*\b(?:Array|NDArray|Complex)\b")


def _is_compared(made: ast.ClassDef) -> bool:
    """Whether it is a dataclass whose arrays `==` would compare."""
    told = [ast.unparse(each) for each in made.decorator_list if "dataclass" in ast.unparse(each)]
    kinds = [ast.unparse(each.annotation) for each in made.body if isinstance(each, ast.AnnAssign)]
    return any("eq=False" not in each for each in told) and any(map(ARRAY.search, kinds))


def _may_change(made: ast.ClassDef) -> bool:
    """Whether it is a dataclass that is not frozen."""
    told = [ast.unparse(each) for each in made.decorator_list if "dataclass" in ast.unparse(each)]
    return any("frozen=True" not in each for each in told)


def test_classes_that_hold_arrays_are_told_apart_by_identity() -> None:
    made = [
        (f"{path.relative_to(PACKAGE)}: {node.name}", node)
        for path in python_files()
        if path.relative_to(PACKAGE).as_posix().startswith(PACKAGES)
        for node in nodes(tree(path))
        if isinstance(node, ast.ClassDef)
    ]
    assert not [name for name, node in made if _is_compared(node)], "(frozen=True, eq=False)"
    assert not [name for name, node in made if _may_change(node)], "(frozen=True)"
    (planted,) = ast.parse("@dataclass(frozen=True)\nclass A:\n    x: Array | None = None").body
    assert isinstance(planted, ast.ClassDef)
    assert _is_compared(planted)
    assert not _may_change(planted)
    (loose,) = ast.parse("@dataclass(frozen=False)\nclass A:\n    x: int").body
    assert isinstance(loose, ast.ClassDef)
    assert _may_change(loose)
