"""Every public name is documented: units, shapes, errors, source, and an example that runs."""

from __future__ import annotations

import inspect
import re
import types

import flightid

PUBLIC = [name for name in flightid.__all__ if not name.startswith("__")]
# A verb's numbers come from somewhere; these take or show data without a formula.
NO_FORMULA = {"fleet_status", "open", "propose_fleet", "read_fleet", "run_fleet"} | {
    "read_log",
    "read_records",
    "load_model",
    "run_study",
    "inspect_log",
    "write_records",
}


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


def _without_example(name: str, item: object) -> list[str]:
    # The examples themselves run as doctests of the suite.
    if ">>> " in (inspect.getdoc(item) or "") or isinstance(item, str):
        return []
    return [f"{name}: no example"]


def _has_section(document: str, title: str) -> bool:
    return re.search(rf"^{title}\n-+$", document, re.MULTILINE) is not None


def _missing_of_function(name: str, item: types.FunctionType) -> list[str]:
    document = inspect.getdoc(item) or ""
    parameters = [key for key in inspect.signature(item).parameters if key not in ("self", "cls")]
    # A picture computes nothing, and seldom refuses.
    is_picture = name.startswith("plot.")
    raises = not is_picture or "raise " in inspect.getsource(item)
    returned = str(inspect.signature(item).return_annotation)
    # The name of a class says all: shapes, units and members of tuples are what annotations lack.
    says_all = returned not in ("Array", "Complex") and re.fullmatch(r"[A-Z]\w+", returned)
    sections = [*([] if says_all else ["Returns"]), *(["Raises"] if raises else [])]
    sections += ["Parameters"] if parameters else []
    if name.rsplit(".", maxsplit=1)[-1] not in NO_FORMULA and not is_picture:
        sections.append("References?")
    missing = [
        f"{name}: no section {title}" for title in sections if not _has_section(document, title)
    ]
    return missing + [
        f"{name}: {key} is not documented"
        for key in parameters
        if not re.search(rf"\b{key}\b", document)
    ]


def _missing_of_class(name: str, item: type) -> list[str]:
    return [
        f"{name}.{key} is not documented"
        for key, member in vars(item).items()
        if not key.startswith("_")
        and (inspect.isfunction(member) or isinstance(member, property))
        and not inspect.getdoc(member)
    ]


def test_every_name_has_an_example_that_runs() -> None:
    offenders = [line for name, item in _members() for line in _without_example(name, item)]
    assert not offenders, "\n".join(offenders)


def test_functions_document_parameters_results_errors_and_source() -> None:
    functions = [(name, item) for name, item in _members() if inspect.isfunction(item)]
    assert len(functions) > 20
    offenders = [line for name, item in functions for line in _missing_of_function(name, item)]
    assert not offenders, "\n".join(offenders)


def test_classes_document_their_public_methods() -> None:
    classes = [(name, item) for name, item in _members() if inspect.isclass(item)]
    assert len(classes) > 20
    offenders = [line for name, item in classes for line in _missing_of_class(name, item)]
    assert not offenders, "\n".join(offenders)


def _documented_in_part(gain: float) -> float:
    """Double a gain.

    Returns
    -------
    The double.
    """
    return 2.0 * gain


class _DocumentedInPart:
    def told(self) -> None:
        """Say something."""

    def untold(self) -> None: ...

    @property
    def unnamed(self) -> int:
        return 1


def test_the_rules_can_fail() -> None:
    assert _without_example("f", _documented_in_part) == ["f: no example"]
    assert _missing_of_function("f", _documented_in_part) == [
        "f: no section Raises",
        "f: no section Parameters",
        "f: no section References?",
    ]
    missing = _missing_of_function("f", _undocumented)
    assert (missing[0], missing[-1]) == ("f: no section Returns", "f: gain is not documented")
    assert _missing_of_class("C", _DocumentedInPart) == [
        "C.untold is not documented",
        "C.unnamed is not documented",
    ]


def _undocumented(gain: float) -> float: ...
