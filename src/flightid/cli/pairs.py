"""Options of the form NAME=VALUE, which several commands take."""

from __future__ import annotations

from collections.abc import Iterable

import click


def pairs(option: str, given: Iterable[str]) -> dict[str, str]:
    """Values by name.

    Raises
    ------
    click.UsageError
        A text without ``=``, or a name given twice.

    Example
    -------
    >>> pairs("--value", ["Mq=-3"])
    {'Mq': '-3'}
    """
    found: dict[str, str] = {}
    for text in given:
        name, mark, value = text.partition("=")
        if not mark or not name or name in found:
            raise click.UsageError(f"{option} {text!r} must be NAME=VALUE, each name once")
        found[name] = value
    return found


def numbers(option: str, given: Iterable[str]) -> dict[str, float]:
    """Numbers by name.

    Raises
    ------
    click.UsageError
        As `pairs`, and for what is no number.

    Example
    -------
    >>> numbers("--value", ["Mq=-3"])
    {'Mq': -3.0}
    """
    found = {}
    for name, value in pairs(option, given).items():
        try:
            found[name] = float(value)
        except ValueError as error:
            raise click.UsageError(f"{option} {name}={value!r} is no number") from error
    return found
