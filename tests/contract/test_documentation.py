"""Every public name is documented: units, shapes, errors, source, and an example that runs."""

from __future__ import annotations

import inspect
import re
import types

import pytest

import flightid

PUBLIC = [name for name in flightid.__all__ if not name.startswith("__")]
# A verb's numbers come from somewhere; these take or show data without a formula.
NO_FORMULA = {"read_log", "read_records", "load_model", "run_study", "inspect_log", "write_records"}


def _members() -> list[tuple[str, object]]:
    """Public names, and for a public module the names in its __all__."""
    found: list[tuple[str, object]] = []
    for name in PUBLIC:
        item = getattr(flightid, name)
        if isinstance(item, types.ModuleType):
            found += [(f"{name}.{key}", getattr(item, key)) for key in item.__all__]
        else:
            found.append((name, item))
    return found


MEMBERS = _members()
FUNCTIONS = [(name, item) for name, item in MEMBERS if inspect.isfunction(item)]
CLASSES = [(name, item) for name, item in MEMBERS if inspect.isclass(item)]


@pytest.mark.parametrize(("name", "item"), MEMBERS, ids=[name for name, _ in MEMBERS])
def test_has_an_example_that_runs(name: str, item: object) -> None:
    # The examples themselves run as doctests of the suite.
    assert ">>> " in (inspect.getdoc(item) or "") or isinstance(item, str), f"{name}: no example"


@pytest.mark.parametrize(("name", "item"), FUNCTIONS, ids=[name for name, _ in FUNCTIONS])
def test_function_documents_parameters_results_errors_and_source(name: str, item: object) -> None:
    document = inspect.getdoc(item) or ""
    parameters = [p for p in inspect.signature(item).parameters if p not in ("self", "cls")]  # type: ignore[arg-type]
    for section in ["Returns", "Raises", *(["Parameters"] if parameters else [])]:
        assert re.search(rf"^{section}\n-+$", document, re.MULTILINE), (
            f"{name}: no section {section}"
        )
    for parameter in parameters:
        assert re.search(rf"\b{parameter}\b", document), f"{name}: {parameter} is not documented"
    if name.rsplit(".", maxsplit=1)[-1] not in NO_FORMULA:
        assert re.search(r"^References?\n-+$", document, re.MULTILINE), (
            f"{name}: no section Reference"
        )


@pytest.mark.parametrize(("name", "item"), CLASSES, ids=[name for name, _ in CLASSES])
def test_class_documents_its_public_methods(name: str, item: type) -> None:
    for key, member in vars(item).items():
        if key.startswith("_") or not (inspect.isfunction(member) or isinstance(member, property)):
            continue
        assert inspect.getdoc(member), f"{name}.{key} is not documented"
