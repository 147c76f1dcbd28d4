"""Text in lines of one width, in which file names and commands stay whole and nothing is obeyed."""

from __future__ import annotations

import re
from textwrap import wrap

GLUE = "\ue000"
"""Stands for a space where no line ends; of the letters that no text uses."""
ARGUMENT = r"(?: --?[a-z][\w-]*(?: (?!-)[^\s,;:]+)?| [A-Z]+\b| [^\s,;:]*[./_\d][^\s,;:]*)"
COMMAND = re.compile(rf"flightid [a-z][a-z-]*{ARGUMENT}*")
"""A verb with options, their values, files and placeholders, up to the first other word."""

BROKEN = re.compile(r"[\t\n\v\f\r]|\s\Z")
"""What does not stay in a line as it is."""
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""What terminals obey, and what turns the direction of text."""


def without_controls(text: str) -> str:
    r"""Text of strangers as a terminal may show it; lines and tabs stay.

    Example
    -------
    >>> without_controls("V1\x1b[31m") == "V1\N{REPLACEMENT CHARACTER}[31m"
    True
    """
    return CONTROL.sub("\N{REPLACEMENT CHARACTER}", text)


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
    if len(first) + len(text) <= width and not BROKEN.search(text):
        return [first + text] if text else []
    whole = COMMAND.sub(lambda found: found[0].replace(" ", GLUE), text)
    lines = wrap(
        whole, width, initial_indent=first, subsequent_indent=later,
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip
    return [line.replace(GLUE, " ") for line in lines]
