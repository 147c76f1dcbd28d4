"""One name for one thing: fields of options, arguments, options of commands, keys of studies."""

from __future__ import annotations

import ast
import dataclasses
import inspect
from collections.abc import Callable, Iterator
from typing import Any

import click
import pytest
from tools.options_page import sections

import flightid as fid
from flightid.cli.option_fields import IN_HERTZ, SHORT, OptionsCommand, flags_of, hertz
from flightid.cli.program import program
from flightid.control.margins.options import (
    DiskMarginOptions,
    DisturbanceOptions,
    MarginOptions,
)
from flightid.dynamics.handling_qualities.options import CutoffOptions, QualitiesOptions
from flightid.dynamics.lower_order.options import LowerOrderOptions
from flightid.dynamics.rotor.options import RotorOptions
from flightid.excitation.options import DesignOptions
from flightid.identification.prediction.request import PredictionOptions
from flightid.logs import Log
from flightid.logs.options import PartOptions
from flightid.models.polynomial.orders import ScanOptions
from flightid.options import Options, options_of
from flightid.planning.options import PlanOptions
from flightid.record.options import ReadOptions
from flightid.responses.options import ResponseOptions
from flightid.simulation.options import SimulationOptions
from flightid.study.published import MeanSquareErrors
from flightid.study.reading import TableReader
from flightid.validation.residuals.options import ResidualTestOptions
from flightid.validation.verification.options import VerifyOptions
from tests.contract.source import PACKAGE, nodes, python_files, tree
from tests.contract.test_arguments import DICTIONARY, WORD_OF

# What a command is told beside the options of its verb: its name, and the one thing it means.
OF_COMMANDS = {
    "actuator": "known element ahead of a vehicle in a loop",
    "all": "everything, not one screen of it",
    "against": "another model beside the one on trial",
    "blocks": "file of a law made of blocks",
    "axis": "roll, pitch or yaw, or an autopilot's number of it",
    "debug": "traceback of an error",
    "forget_gone": "no records of logs that are nowhere",
    "joint_fit": "responses of a fleet's flights fitted together",
    "format": "tool that an export is for",
    "gains": "file of tuned gains to fly",
    "help": "this text",
    "html": "page to write",
    "json": "print one JSON document",
    "kind": "of a model without equations",
    "estimate": "instrument errors of a check of data compatibility",
    "level": "probability of intervals",
    "log": "a flight log",
    "method": "algorithm of this verb",
    "earlier": "records of earlier versions count too",
    "model": "a model by name or file",
    "most_rows": "longest answer",
    "name": "name of what is made",
    "no_browser": "print the address of the page and open nothing",
    "output": "folder that is written",
    "pair": "output and input of a saved response",
    "rename": "columns that stand for channels of other names",
    "overwrite": "whether a file may be replaced",
    "quiet": "no progress",
    "records": "records beside the data",
    "records_span_s": "part of those records",
    "reduce": "drop what the data do not determine",
    "residual_tests": "test residuals",
    "retry": "take failed logs again",
    "scan": "try several orders",
    "scheduler": "address of a cluster",
    "port": "where the page is served on this machine",
    "scenario": "flight to simulate",
    "seed": "seed of random numbers",
    "stick_deg": "largest move of a simulated pilot",
    "tune": "gains at the end",
    "unpacked": "a page without compression",
    "validation": "records that a fit has not seen",
    "value": "another parameter value",
    "version": "this version",
    "workers": "processes of this machine",
    "write": "file that is written",
    "write_no_go": "whether a no-go plan leaves settings",
}
# Files of published figures keep the words of papers.
FIELDS = {
    each.name
    for options in sections().values()
    if options is not MeanSquareErrors
    for each in options_of(options)
}
# A verb -> the dataclass whose fields its arguments are, and fields that a caller gives otherwise.
VERBS: dict[Callable[..., Any], tuple[type[Options], set[str]]] = {
    fid.estimate_response: (ResponseOptions, set()),
    fid.simulate: (SimulationOptions, set()),
    fid.residual_tests: (ResidualTestOptions, set()),
    fid.margins: (MarginOptions, set()),
    fid.disk_margin: (DiskMarginOptions, set()),
    fid.disturbance_rejection: (DisturbanceOptions, set()),
    fid.lower_order: (LowerOrderOptions, set()),
    fid.rotor_physics: (RotorOptions, set()),
    fid.pilot_cutoff: (CutoffOptions, set()),
    fid.predict: (PredictionOptions, set()),
    fid.handling_qualities: (QualitiesOptions, set()),
    fid.verify: (VerifyOptions, set()),
    fid.read_records: (ReadOptions, set()),
    fid.excitation.plan: (DesignOptions, set()),
    fid.plan_flight: (PlanOptions, set()),
    Log.record: (PartOptions, set()),
    fid.scan_orders: (ScanOptions, {"na", "nb", "nc", "nd", "nf", "nk"}),  # ranges by default
}
KEY_READERS = {"table", "tables", "rows", "values"}


def _commands(group: click.Group = program, path: str = "") -> Iterator[tuple[str, click.Command]]:
    context = click.Context(group)
    for name in group.list_commands(context):
        found = group.get_command(context, name)
        assert found is not None
        if isinstance(found, click.Group):
            yield from _commands(found, f"{path}{name} ")
        else:
            yield f"{path}{name}", found


def _typed() -> Iterator[tuple[str, str, list[str]]]:
    """Command, name of an option as it is typed, and all its spellings."""
    for command, found in _commands():
        for param in found.get_params(click.Context(found)):
            if isinstance(param, click.Option):
                spelled = [opt for opt in param.opts if opt.startswith("--")]
                yield command, spelled[0].removeprefix("--").replace("-", "_"), spelled


def _not_in_hertz() -> Iterator[tuple[str, str, list[str]]]:
    """The same without the second spelling of a frequency, in hertz."""
    return (each for each in _typed() if each[1] not in map(hertz, IN_HERTZ))


def _keys() -> Iterator[tuple[str, str]]:
    """File and name of every table that a study reads."""
    for path in python_files():
        if path.parent.name != "study":
            continue
        for node in nodes(tree(path)):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            first = next((arg for arg in node.args if isinstance(arg, ast.Constant)), None)
            if node.func.attr in KEY_READERS and first is not None and isinstance(first.value, str):
                yield str(path.relative_to(PACKAGE)), first.value


def test_a_command_says_what_the_fields_say_or_a_word_of_commands() -> None:
    typed = list(_typed())
    assert len({command for command, _, _ in typed}) > 12
    stray = [
        f"{command}: --{word} is neither a field of options nor a word of commands"
        for command, word, _ in _not_in_hertz()
        if word not in FIELDS and word not in OF_COMMANDS
    ]
    assert not stray, "\n".join(stray)


def test_every_option_is_spelled_alike_in_all_commands() -> None:
    spelled: dict[str, set[tuple[str, ...]]] = {}
    for _, word, options in _typed():
        spelled.setdefault(word, set()).add(tuple(options))
    assert not {word: found for word, found in spelled.items() if len(found) > 1}
    for word in SHORT:
        assert spelled[word] == {tuple(flags_of(word))}, word
    assert not set(SHORT.values()) & set(spelled), "a short form is the whole name of another"


def test_no_name_is_a_synonym() -> None:
    names = {word for _, word, _ in _not_in_hertz()} | FIELDS | {key for _, key in _keys()}
    assert len({key for _, key in _keys()}) > 10
    offenders = [f"{name} is called {WORD_OF[name]} here" for name in names if name in WORD_OF]
    assert not offenders, "\n".join(sorted(offenders))


def test_no_word_of_commands_is_left_over() -> None:
    typed = {word for _, word, _ in _typed()} | {"debug", "quiet", "version"}
    assert not OF_COMMANDS.keys() - typed


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb.__name__)
def test_arguments_of_a_verb_are_the_fields_of_its_options(verb: Callable[..., Any]) -> None:
    options, otherwise = VERBS[verb]
    arguments = inspect.signature(verb).parameters
    assert options_of(options)
    for each in options_of(options):
        assert each.name in arguments, f"{verb.__name__} has no {each.name}"
        default = arguments[each.name].default
        if each.name in otherwise:
            continue
        needed = default is inspect.Parameter.empty
        assert needed == (each.default is dataclasses.MISSING), each.name
        assert needed or default == each.default or (default is None and not each.default), (
            f"{verb.__name__}: {each.name} is {default!r}, its field {each.default!r}"
        )


def test_commands_with_options_of_fields_read_them_all() -> None:
    """No option of a verb is written by hand: the commands of verbs with fields read the fields."""
    reading = {name for name, found in _commands() if isinstance(found, OptionsCommand)}
    assert reading == {
        "advise", "compare-structures", "consistency", "design", "disk-margin",
        "disturbance-rejection", "export", "fly", "handling-qualities", "identify", "lower-order",
        "margins", "new", "pilot-cutoff", "plan", "polynomial", "predict", "response",
        "rotor-physics", "run", "simulate model", "tune", "verify",
    }  # fmt: skip
    for name, found in _commands():
        if isinstance(found, OptionsCommand):
            by_hand = {param.name for param in found.params} & FIELDS
            assert by_hand <= OF_COMMANDS.keys() | {"feedback", "rivals"}, (
                name,
                by_hand,
            )


def test_a_file_is_written_by_one_option_and_a_folder_by_another() -> None:
    named = {
        (name, option, bool(getattr(param.type, "file_okay", False)))
        for name, found in _commands()
        for param in found.params
        for option in param.opts
        if option in ("--write", "--output")
    }
    assert {option for _, option, is_file in named if is_file} == {"--write"}
    assert {name for name, option, is_file in named if not is_file} == {"run", "tune", "plan"}
    assert len(named) == 16


def test_a_word_of_the_dictionary_has_one_name_in_all_places() -> None:
    assert not {word for word in OF_COMMANDS if word in WORD_OF}
    assert {"band_rad_s", "hold", "initial_state", "seed"} <= DICTIONARY.keys() & FIELDS


def test_every_table_of_a_study_is_on_the_page_of_options() -> None:
    """What a study file says is read by fields alone, and each of them is documented."""
    listed = {each for options in sections().values() for each in options.__mro__}
    classes = [*Options.__subclasses__()]
    for kind in classes:
        classes += kind.__subclasses__()
    tables = {kind for kind in classes if kind.__module__.startswith("flightid.study")}
    assert len({kind for kind in tables if options_of(kind)}) > 20
    assert not {kind for kind in tables - listed if options_of(kind)}
    readers = {name for name in vars(TableReader) if not name.startswith("_")}
    kept = {"told", "where", "options", "values", "table", "rows", "tables", "finish", "error"}
    assert readers == kept, "a key is read by hand, not by a field"
