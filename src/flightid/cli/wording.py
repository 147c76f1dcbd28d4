"""Options in errors and findings as they are typed, in the command where the user stands."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from shlex import quote

import click

from flightid.cli.option_fields import NONE, OptionsCommand
from flightid.surface import ANY, GIVEN, PAIR, held_in, replaced

NAME = re.compile(r"(?<![\w.\-/\[])[a-z][a-z0-9]*(?:_[a-z0-9]+)+(?![\w(=.])(?! = )")
KEYED = re.compile(
    r"(?<![\w.\-\[])(?P<name>[a-z][a-z0-9_]*) = "
    r"(?:(?P<yes>true\b)|\"(?P<word>[^\"\s]+)\"|\{ (?P<key>[^\s=]+) = \"(?P<own>[^\"]*)\" \})"
)
"""An option as the key of a study has it, which what a study found says."""
ENDS = re.compile(r"[\[(](-?[\d.]+), (-?[\d.]+)[\])]")
"""Two ends of a span or a band, which a command takes one after the other."""
VERB = re.compile(r"\b(?:flightid|fid)\.([a-z_]+)\b(?:\([^)]*\))?")


def as_typed(text: str) -> str:
    """Options with their dashes, verbs as commands, in the command that runs; else as they are.

    Example
    -------
    >>> as_typed("declare hold=…")
    'declare hold=…'
    """
    here = click.get_current_context(silent=True)
    # What is said while a command's options are still being read speaks of none of them.
    if here is None or (isinstance(here.command, OptionsCommand) and not here.command.is_read):
        return text
    known, program = _flags(here.command), here.find_root().command
    text = held_in(text, "the model's file")
    made = replaced(GIVEN, lambda found: _given(found, known, program), text)
    if not _is_of_study(here):
        made = KEYED.sub(lambda found: _keyed(found, known), made)
    made = replaced(NAME, lambda found: known.get(found[0], [found[0]])[-1], made)
    return _reachable(VERB.sub(lambda found: _verb(found, program), made), here)


def _reachable(text: str, here: click.Context) -> str:
    """Commands that name a file of this one, with the path by which it was given."""
    for path in _paths(here):
        named = rf"(\bflightid [a-z-]+ ){re.escape(path.name)}(?![\w./-]*\w)"
        way = quote(str(path)).replace("\\", r"\\")
        text = re.sub(named, rf"\g<1>{way}", text)
    return text


def _paths(here: click.Context) -> Iterator[Path]:
    for value in here.params.values():
        several = value if isinstance(value, tuple) else (value,)
        yield from (each for each in several if isinstance(each, Path))


def _given(found: re.Match[str], known: dict[str, list[str]], program: click.Command) -> str:
    name, value = found["name"], found["value"] or ""
    command, flags = ("", known[name]) if name in known else _anywhere(program).get(name, ("", []))
    if not flags:
        return found[0]
    told = [flag for flag in flags if not flag.startswith("--no-")]
    of = f" of flightid {command}" if command else ""
    if ANY.fullmatch(value) or value == "True":
        return told[-1] + of
    if value == "False":
        return (flags[0] if flags != told else f"{told[-1]} {NONE}") + of
    if pair := PAIR.fullmatch(value):
        return f"{told[-1]} {pair['key']}={pair['value']}{of}"
    if ends := ENDS.fullmatch(value):
        return f"{told[-1]} {ends[1]} {ends[2]}{of}"
    plain = NONE if value == "None" else value.strip("'\"")
    return f"{told[-1]} {plain if ' ' not in plain else repr(plain)}{of}"


def _is_of_study(here: click.Context) -> bool:
    """Whether a file of keys was given: there keys are what the reader writes."""
    given = [here.params.get(each.name or "") for each in here.command.params if _is_place(each)]
    several = [each if isinstance(each, tuple) else (each,) for each in given]
    return any(isinstance(e, Path) and e.suffix == ".toml" for each in several for e in each)


def _is_place(parameter: click.Parameter) -> bool:
    return isinstance(parameter, click.Argument)


def _keyed(found: re.Match[str], known: dict[str, list[str]]) -> str:
    """A key as an option of this command; as it is where the command has none of its name."""
    told = [flag for flag in known.get(found["name"], ()) if not flag.startswith("--no-")]
    if not told:
        return found[0]
    if found["yes"]:
        return told[-1]
    word = found["word"]
    return f"{told[-1]} {word}" if word else f"{told[-1]} {found['key']}={found['own']}"


def _verb(found: re.Match[str], program: click.Command) -> str:
    return f"flightid {found[1]}" if found[1] in _verbs(program) else found[0]


def _verbs(program: click.Command) -> list[str]:
    return program.list_commands(click.Context(program)) if isinstance(program, click.Group) else []


@cache
def _anywhere(program: click.Command) -> dict[str, tuple[str, list[str]]]:
    """A command that has an option of a name, and its flags there, by name."""
    made: dict[str, tuple[str, list[str]]] = {}
    for verb in _verbs(program):
        assert isinstance(program, click.Group)
        command = program.get_command(click.Context(program), verb)
        for name, flags in _flags(command).items() if command is not None else ():
            made.setdefault(name, (verb, flags))
    return made


@cache
def _flags(command: click.Command) -> dict[str, list[str]]:
    """Flags by name of option: what switches it off first, the shortest last."""
    return {
        each.name: [*each.secondary_opts, *sorted(each.opts, key=len, reverse=True)]
        for each in command.get_params(click.Context(command))
        if isinstance(each, click.Option) and each.name
    }
