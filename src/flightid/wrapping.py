"""Text in lines of one width, in which file names and commands stay whole."""

from __future__ import annotations

from textwrap import wrap


def wrapped(text: str, width: int, *, first: str = "", later: str = "") -> list[str]:
    """Lines of a text, broken at spaces alone: a path with a hyphen can be copied.

    Parameters
    ----------
    text : str
    width : int
        Letters in a line; a longer word has a line of its own.
    first, later : str
        What the first line and the others begin with.

    Example
    -------
    >>> wrapped("next: flightid run monday-flight.toml", 24)
    ['next: flightid run', 'monday-flight.toml']
    """
    return wrap(
        text, width, initial_indent=first, subsequent_indent=later,
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip
