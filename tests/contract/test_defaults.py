"""What a verb does where nobody says anything: nothing dangerous, and what its options say."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from flightid.control.tuning.options import TuneOptions
from flightid.control.tuning.tune import tune
from flightid.control.tuning.tune_controller import tune_controller
from flightid.control.tuning.tune_pid import tune_pid
from flightid.options import options_of
from tests.contract.source import PACKAGE, nodes, python_files, tree

DANGEROUS = {
    "overwrite": "replaces what stands there",
    "accept_red": "makes what the data refuse",
    "nominal": "takes a model without its errors",
    "formed": "would call an array made that is not there",
}


def _on_by_default(module: ast.Module) -> Iterator[str]:
    """Functions and dataclasses in which an argument of those is anything but False."""
    for node in nodes(module):
        told: list[tuple[str, ast.expr | None]] = []
        if isinstance(node, ast.FunctionDef):
            names = [*node.args.posonlyargs, *node.args.args]
            found = node.args.defaults
            told = [
                (a.arg, d) for a, d in zip(names[len(names) - len(found) :], found, strict=True)
            ]
            told += [
                (a.arg, d) for a, d in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
            ]
        elif isinstance(node, ast.ClassDef):
            told = [
                (each.target.id, each.value)
                for each in node.body
                if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
            ]
        for name, value in told:
            if name in DANGEROUS and isinstance(value, ast.Constant) and value.value is not False:
                yield f"{node.name}: {name}"  # type: ignore[attr-defined]


def test_arguments_may_be_named_and_those_behind_a_star_must_be() -> None:
    """A slash in place of a star would ask for the other of both."""
    found = {
        f"{path.stem}.{node.name}"
        for path in python_files()
        for node in nodes(tree(path))
        if isinstance(node, ast.FunctionDef) and node.args.posonlyargs
    }
    # As `dataclass` has it, and a protocol in which that argument may have any name.
    assert found == {"frozen._dataclass", "sampling_rate.frequency_response"}


def test_what_is_dangerous_is_asked_for() -> None:
    found = [
        f"{path.relative_to(PACKAGE)}: {each}"
        for path in python_files()
        for each in _on_by_default(tree(path))
    ]
    assert not found, DANGEROUS
    planted = "def f(a, overwrite=True, *, accept_red=True): ...\ndef g(*, overwrite): ..."
    planted += "\nclass A:\n    nominal: bool = True\n    formed: bool = False"
    assert list(_on_by_default(ast.parse(planted))) == [
        "f: overwrite", "f: accept_red", "A: nominal",
    ]  # fmt: skip


@pytest.mark.parametrize("verb", [tune, tune_pid, tune_controller])
def test_a_search_for_gains_does_what_its_options_say(verb: Callable[..., Any]) -> None:
    told = {each.name: each.default for each in options_of(TuneOptions)}
    own = {
        name: each.default
        for name, each in inspect.signature(verb).parameters.items()
        if name in told and name != "filters" and each.default is not inspect.Parameter.empty
    }
    assert own == {name: told[name] for name in own}
    assert {"draws", "seed", "nominal", "accept_red"} <= own.keys()


def test_one_axis_is_the_roll_axis_of_a_vehicle_that_answers_its_command() -> None:
    told = inspect.signature(tune_pid).parameters
    assert (told["axis"].default, told["sign"].default) == ("roll", 1)
