"""What every command prints, and where: results to standard output, everything else beside it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import click

from flightid.cli.figures import QuotientRange

if TYPE_CHECKING:
    from flightid.findings import Finding

Function = TypeVar("Function", bound=Callable[..., Any])
WRITTEN = click.Path(dir_okay=False, path_type=Path)
"""A file that a command writes."""


def of_a_page(context: click.Context, option: click.Parameter, path: Path | None) -> Path | None:
    """Refuse what is no name of a page: a log would be lost that a mistyped command names there."""
    if path is not None and path.suffix.lower() not in (".html", ".htm"):
        raise click.BadParameter(f"{path} does not end in .html: name a page.", context, option)
    return path


class Exit(IntEnum):
    """Exit codes of every command."""

    DONE = 0
    RED = 1
    UNUSABLE = 2
    FAULT = 70
    INTERRUPTED = 130


class CommandResult(Protocol):
    """A result: text for people, plain values for programs."""

    def summary(self) -> object:
        """Table or text."""

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""


def json_option(function: Function) -> Function:
    """Add ``--json`` to a command; its argument is ``as_json``."""
    decorate = click.option(
        "--json", "as_json", is_flag=True, help="Print one JSON document instead of text."
    )
    return decorate(function)


def level_option(function: Function) -> Function:
    """Add ``--level`` to a command that prints intervals; its argument is ``level``."""
    decorate = click.option(
        "--level",
        type=QuotientRange(0.0, 1.0, min_open=True, max_open=True),
        help="Probability of the intervals printed, for example 0.9; default: 0.95.",
    )
    return decorate(function)


WHOLE = "flightid.whole"
SHORT = 40
"""Rows of a table on one screen."""


def all_option(function: Function) -> Function:
    """Add ``--all`` to a command whose tables may be long."""

    def keep(ctx: click.Context, _: click.Parameter, value: bool) -> None:
        ctx.meta[WHOLE] = value

    decorate = click.option(
        "--all",
        is_flag=True,
        expose_value=False,
        callback=keep,
        help=f"Print every line of long tables, not the first {SHORT}.",
    )
    return decorate(function)


def in_short(table: object) -> str:
    """A table's first lines, and how to see the others; all where ``--all`` was given."""
    from flightid.table import Table

    context = click.get_current_context(silent=True)
    whole = context is None or context.meta.get(WHOLE, True)
    if whole or not isinstance(table, Table) or len(table.rows) <= SHORT:
        return str(table)
    left = f"{len(table.rows) - SHORT} more lines: --all shows them."
    return str(replace(table, rows=table.rows[:SHORT], notes=(left, *table.notes)))


def verdicts_last(table: object) -> object:
    """A table whose notes end with its verdicts, the worst last, each once, then its light.

    Pages and files keep the order of the result: there eyes are at the top.
    """
    from flightid.conventions import Light
    from flightid.findings import GRAVITY
    from flightid.table import Table

    if not isinstance(table, Table):
        return table
    ranks = {f"[{light.words}] ": -GRAVITY.index(light) for light in Light}
    ends = {"Light: ": 1}

    def rank(note: str) -> int | None:
        return next((at for begin, at in (ranks | ends).items() if note.startswith(begin)), None)

    notes = list(dict.fromkeys(table.notes))
    told = sorted((each for each in notes if rank(each) is not None), key=lambda e: rank(e) or 0)
    return replace(table, notes=(*(each for each in notes if rank(each) is None), *told))


def emit(result: CommandResult, *, as_json: bool, level: float | None = None) -> None:
    """Print a result to standard output.

    Parameters
    ----------
    result : object with ``summary()`` and ``to_dict()``
        What the command made.
    as_json : bool
        One JSON document instead of text.
    level : float, optional
        Of the intervals in its text.
    """
    from flightid.uncertainty.quantiles import showing

    with showing(level):
        if as_json:
            emit_values(result.to_dict())
        else:
            click.echo(in_short(verdicts_last(result.summary())))


def emit_values(values: object) -> None:
    """Print plain values as one JSON document; a number that is not finite is a fault."""
    click.echo(json.dumps(values, indent=2, allow_nan=False, ensure_ascii=False))


def finite(values: Any) -> Any:  # noqa: ANN401 - plain values of any depth
    """The same plain values with null for numbers that JSON does not have.

    Example
    -------
    >>> finite([{"r": float("nan")}, {"r": 0.5}])
    [{'r': None}, {'r': 0.5}]
    """
    if isinstance(values, dict):
        return {name: finite(each) for name, each in values.items()}
    if isinstance(values, list | tuple):
        return [finite(each) for each in values]
    return None if isinstance(values, float) and not math.isfinite(values) else values


def note(text: str) -> None:
    """Print a note for people to standard error."""
    click.echo(text, err=True)


def leave_by_verdict(findings: Iterable[Finding]) -> None:
    """End the command with exit code 1 if a finding is red; call it last."""
    from flightid.conventions import Light

    if any(finding.light is Light.RED for finding in findings):
        click.get_current_context().exit(Exit.RED)
