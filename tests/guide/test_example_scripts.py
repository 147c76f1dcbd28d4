"""Scripts of all examples without a flight: they load, and what they call takes what they give.

`test_examples.py` runs the short ones whole; the long ones run there every night.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import pytest

from flightid.study.settings import read_settings

EXAMPLES = Path(__file__).parent.parent.parent / "examples"
FOLDERS = sorted({path.parent for path in EXAMPLES.glob("*/*.py")})
STUDIES = sorted(EXAMPLES.glob("*/study.toml")) + sorted(EXAMPLES.glob("*/advised.toml"))


@contextmanager
def _loaded(folder: Path) -> Iterator[dict[Path, ModuleType]]:
    """Modules of a folder as its scripts see them; the next folder has others of these names."""
    paths = sorted(folder.glob("*.py"))
    sys.path.insert(0, str(folder))
    try:
        yield {path: importlib.import_module(path.stem) for path in paths}
    finally:
        sys.path.remove(str(folder))
        for path in paths:
            sys.modules.pop(path.stem, None)


def _named(function: ast.expr, names: dict[str, object]) -> object:
    """What a dotted name stands for; None where it is not one of the module's own names."""
    if isinstance(function, ast.Name):
        return names.get(function.id)
    if isinstance(function, ast.Attribute):
        owner = _named(function.value, names)
        return None if owner is None else getattr(owner, function.attr)
    return None


def _misfits(source: str, names: dict[str, object]) -> tuple[int, list[str]]:
    """How many calls go to flightid, and which of them it would not take."""
    checked, misfits = 0, []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        try:
            called = _named(node.func, names)
        except AttributeError as error:
            misfits.append(f"{node.lineno}: {error}")
            continue
        if not callable(called) or not str(getattr(called, "__module__", "")).startswith(
            "flightid"
        ):
            continue
        if any(isinstance(given, ast.Starred) for given in node.args):
            continue
        checked += 1
        keywords = {keyword.arg: None for keyword in node.keywords if keyword.arg}
        try:
            inspect.signature(called).bind_partial(*node.args, **keywords)
        except TypeError as error:
            misfits.append(f"{node.lineno}: {ast.unparse(node.func)}: {error}")
    return checked, misfits


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_scripts_load_and_call_what_there_is(folder: Path) -> None:
    offenders, count = [], 0
    with _loaded(folder) as modules:
        for path, module in modules.items():
            checked, found = _misfits(path.read_text("utf-8"), vars(module))
            count += checked
            offenders += [f"{path.name}:{line}" for line in found]
    assert not offenders, "\n".join(offenders)
    assert count, "no call to flightid was found"


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_study_files_are_read(path: Path) -> None:
    assert read_settings(path).title


def test_a_call_that_does_not_fit_is_named() -> None:
    names: dict[str, object] = {"fid": importlib.import_module("flightid")}
    source = "fid.read_log(p, luck=1)\nfid.modes(m)\nfid.nonsense(m)\nown(luck=1)"
    checked, misfits = _misfits(source, names)
    assert checked == 2
    assert len(misfits) == 2
    assert "luck" in misfits[0]
    assert "nonsense" in misfits[1]
