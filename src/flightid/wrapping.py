"""Text in lines of one width, in which file names and commands stay whole."""

from __future__ import annotations

import re
from textwrap import wrap

GLUE = "\ue000"
"""Stands for a space where no line ends; of the letters that no text uses."""
ARGUMENT = r"(?: --?[a-z][\w-]*(?: (?!-)[^\s,;:]+)?| [A-Z]+\b| [^\s,;:]*[./_\d][^\s,;:]*)"
COMMAND = re.compile(rf"flightid [a-z][a-z-]*{ARGUMENT}*")
"""A verb with options, their values, files and placeholders, up to the first other word."""


def wrapped(text: str, width: int, *, first: str = "", later: str = "") -> list[str]:
    """Lines of a text, broken at spaces outside commands: what is to be typed can be copied.

    Parameters
    ----------
    text : str
    width : int
        Letters in a line; a longer word or command has a line of its own.
    first, later : str
        What the first line and the others begin with.

    Example
    -------
    >>> wrapped("next: flightid run monday-flight.toml --all, then look", 24)
    ['next:', 'flightid run monday-flight.toml --all,', 'then look']
    """
    whole = COMMAND.sub(lambda found: found[0].replace(" ", GLUE), text)
    lines = wrap(
        whole, width, initial_indent=first, subsequent_indent=later,
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip
    return [line.replace(GLUE, " ") for line in lines]
