"""Options that take lists: given again for each, or with commas between."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator
from pathlib import Path
from typing import Any

import click

NEXT_NAME = re.compile(r",(?=[^,=()<>!]+=(?!=))")
"""A comma between two of NAME=VALUE, and none within the brackets of a formula."""
OWN_COMMAS = ("column_names",)
"""Lists that quotes may stand in; they are parted where they are read."""
CHANNELS = ("inputs", "outputs", "excitations")
SPECIAL = ({","}, {*",)]"})
"""Letters of a text that is more than one name, and of one that may be a heading."""


class ListOption(click.Option):
    """An option of numbers or files, repeated or with commas between."""

    def type_cast_value(self, ctx: click.Context, value: Any) -> Any:  # noqa: ANN401 — as click has it
        """Part the texts, then read each."""
        texts = value if value is None else [part for text in value for part in _parts(str(text))]
        return super().type_cast_value(ctx, texts)


class ListsCommand(click.Command):
    """A command whose lists of texts may have commas."""

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 — as click has it
        """Run it with the lists parted."""
        _part_lists(ctx)
        return super().invoke(ctx)


def _part_lists(ctx: click.Context) -> None:
    """Part the texts of lists at their commas; a column of that very name stays whole.

    Names of channels may be headings with their units.
    """
    columns: set[str] | None = None
    for one in ctx.command.get_params(ctx):
        if not (isinstance(one, click.Option) and one.multiple) or one.name in OWN_COMMAS:
            continue
        given = ctx.params.get(str(one.name)) or ()
        is_channels = one.name in CHANNELS
        if any(isinstance(text, str) and (SPECIAL[is_channels] & {*text}) for text in given):
            columns = set(_columns(ctx.params.values())) if columns is None else columns
            parts = [part for text in given for part in _parts(text, columns)]
            ctx.params[str(one.name)] = tuple(
                _channel(part, columns) if is_channels else part for part in parts
            )


def _channel(name: str, columns: Container[str]) -> str:
    """The channel that a heading names; a topic of a bag keeps its slashes."""
    from flightid.record.formats.columns import channel_name

    return name if name.startswith("/") else channel_name(name, columns)


def _parts(text: str, whole: Container[str] = ()) -> list[str]:
    """What stands between the commas.

    Example
    -------
    >>> _parts("u, v"), _parts("a,b", {"a,b"}), _parts("p=rad/s,q=deg/s"), _parts("r=max(u,v)")
    (['u', 'v'], ['a,b'], ['p=rad/s', 'q=deg/s'], ['r=max(u,v)'])
    """
    if text in whole or Path(text).exists():
        return [text]
    return [part.strip() for part in (NEXT_NAME.split(text) if "=" in text else text.split(","))]


def _columns(values: Iterable[object]) -> Iterator[str]:
    """Names of columns of the tables that a command was given."""
    from flightid.errors import FlightidError
    from flightid.logs import is_log
    from flightid.record.formats import file_format
    from flightid.record.formats.columns import channel_name
    from flightid.record.tables import read_table

    for value in values:
        for path in value if isinstance(value, tuple) else (value,):
            try:
                if isinstance(path, Path) and path.exists() and not is_log(path):
                    for name in read_table(path, file_format(path), ()).lengths:
                        yield from (name, channel_name(name))
            except FlightidError:
                continue  # the command says what is wrong with it
