"""Options in errors and findings are written where the user stands: Python, command, study."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from flightid.cli.option_fields import flags_of
from flightid.cli.program import program
from flightid.cli.wording import as_typed
from flightid.errors import OptionError
from flightid.surface import GIVEN, as_key, speaking
from tests.contract.source import PACKAGE, nodes, python_files, tree

SAY = {"problem", "found", "needed", "action", "message", "what"}
# Arguments that neither a command nor a study has: their verbs are Python's alone.
PYTHON_ONLY = {
    "after_rise": "reduce; a study says it in [reduce]",
    "cutoff_hz": "smooth",
    "dt": "of python-control's systems",
    "given": "margins of a loop",
    "half_width": "smooth",
    "kind": "lower_order",
    "n_alpha": "handling qualities; a study says it there",
    "names": "rotor_physics",
    "period_s": "a record's declaration; a study says it in [[record]]",
    "states": "approximate modes",
}


def _told(path_tree: ast.Module) -> Iterator[ast.Constant]:
    """Texts that errors and findings are made of."""
    for node in nodes(path_tree):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        if name.endswith("Error") or name in ("Finding", "Check"):
            for part in (*node.args, *(each.value for each in node.keywords)):
                for leaf in ast.walk(part):
                    if isinstance(leaf, ast.Constant) and isinstance(leaf.value, str):
                        yield leaf


def test_options_in_errors_are_options_of_a_command_or_of_python_alone() -> None:
    offenders, seen = [], set()
    for path in python_files():
        for leaf in _told(tree(path)):
            with click.Context(program):
                said = as_typed(leaf.value)
            for left in GIVEN.finditer(said):
                seen.add(left["name"])
                if left["name"] not in PYTHON_ONLY:
                    place = f"{path.relative_to(PACKAGE)}:{leaf.lineno}"
                    offenders.append(f"{place}: {left['name']}= is an argument, no option")
    assert not offenders, "\n".join(offenders)
    assert seen, "the scan finds nothing"


@pytest.mark.parametrize(
    "name", ["sample_time_s", "time_column", "band_rad_s", "minimum_coherence"]
)
def test_a_command_says_its_own_flags(name: str) -> None:
    command = program.get_command(click.Context(program), "identify")
    assert command is not None
    command.get_params(click.Context(command))  # as the parser does before anything is said
    with click.Context(command, parent=click.Context(program)), speaking(as_typed):
        said = str(OptionError(f"{name} has no meaning", action=f"give {name}=…"))
    flag = flags_of(name)[-1]
    assert said == f"{flag} has no meaning. Next: give {flag}."


def test_a_command_names_a_file_as_it_was_given() -> None:
    """What is copied from the screen works where the user stands."""
    command = program.get_command(click.Context(program), "inspect")
    assert command is not None
    context = click.Context(command, parent=click.Context(program))
    context.params = {"log": Path("my logs/day.bin"), "whole": False}
    with context:
        said = as_typed("flightid plan day.bin writes a card; flightid run other-day.bin; day.bin")
        assert as_typed("flightid run day.bin.csv") == "flightid run day.bin.csv"
    assert said == (
        "flightid plan 'my logs/day.bin' writes a card; flightid run other-day.bin; day.bin"
    )


def test_what_a_user_wrote_is_no_option() -> None:
    command = program.get_command(click.Context(program), "identify")
    assert command is not None
    command.get_params(click.Context(command))
    with click.Context(command, parent=click.Context(program)):
        said = as_typed("'gyro=rate' and 'time_unit' of the files: time_unit='ms', or join_on=…")
    assert said == "'gyro=rate' and 'time_unit' of the files: --time-unit ms, or --join-on"
    with click.Context(command, parent=click.Context(program)):
        both = as_typed("take span_s=[4.51, 9.99]")
    assert both == "take --span 4.51 9.99", "a bracket cannot be typed"
    assert as_key("'gyro=rate', declare hold='zero'") == "'gyro=rate', declare hold = \"zero\""


def test_keys_of_a_study_are_options_where_records_are_given() -> None:
    """``declare --time-unit = "ms"`` was printed of a run of records: typed, it fails."""
    command = program.get_command(click.Context(program), "run")
    assert command is not None
    command.get_params(click.Context(command))
    key = 'declare time_unit = "ms", or units = { t = "ms" }; kind = "own"'
    context = click.Context(command, parent=click.Context(program))
    place = next(each.name for each in command.params if isinstance(each, click.Argument))
    assert place is not None
    for name, said in (
        ("rig.csv", 'declare --time-unit ms, or --units t=ms; kind = "own"'),
        ("study.toml", key),
    ):
        context.params = {place: (Path(name),)}
        with context:
            assert as_typed(key) == said


def test_each_surface_has_its_spelling() -> None:
    text = "declare hold='zero' and covariance=False"
    assert as_key(text) == 'declare hold = "zero" and covariance = false'
    assert str(OptionError(text)) == text
    with speaking(as_key):
        assert 'hold = "zero"' in str(OptionError(text))
