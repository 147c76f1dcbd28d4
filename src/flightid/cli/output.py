"""What every command prints, and where: results to standard output, everything else beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import click

if TYPE_CHECKING:
    from flightid.findings import Finding

Function = TypeVar("Function", bound=Callable[..., Any])


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
        type=click.FloatRange(0.0, 1.0, min_open=True, max_open=True),
        help="Probability of the intervals printed, for example 0.9; default: 0.95.",
    )
    return decorate(function)


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
    emit_values(result.to_dict()) if as_json else click.echo(str(at_level(result, level)))


def at_level(result: CommandResult, level: float | None) -> object:
    """The table of a result, its intervals at a level where one was asked for."""
    return result.summary() if level is None else result.summary(level=level)  # type: ignore[call-arg]


def emit_values(values: object) -> None:
    """Print plain values as one JSON document; a number that is not finite is a fault."""
    click.echo(json.dumps(values, indent=2, allow_nan=False, ensure_ascii=False))


def note(text: str) -> None:
    """Print a note for people to standard error."""
    click.echo(text, err=True)


def leave_by_verdict(findings: Iterable[Finding]) -> None:
    """End the command with exit code 1 if a finding is red; call it last."""
    from flightid.conventions import Light

    if any(finding.light is Light.RED for finding in findings):
        click.get_current_context().exit(Exit.RED)
