"""What every command prints, and where: results to standard output, everything else beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import click

if TYPE_CHECKING:
    from flightid.findings import Finding

HOLD_HELP = "Inputs between samples: lines or steps. Default: what the records know, else first."
Function = TypeVar("Function", bound=Callable[..., Any])


class Exit(IntEnum):
    """Exit codes of every command."""

    DONE = 0
    RED = 1
    UNUSABLE = 2
    FAULT = 70
    INTERRUPTED = 130


class Shown(Protocol):
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


def emit(result: Shown, *, as_json: bool) -> None:
    """Print a result to standard output.

    Parameters
    ----------
    result : object with ``summary()`` and ``to_dict()``
        What the command made.
    as_json : bool
        One JSON document instead of text.
    """
    emit_values(result.to_dict()) if as_json else click.echo(str(result.summary()))


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
