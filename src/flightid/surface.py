"""Words for options where the user stands: Python, the command line or a study file.

Errors, findings and checks are written as Python has them (``hold="zero"``, ``band_rad_s``,
``flightid.verify``), and pass `spoken` when they are made: a command then says ``--hold zero``, a
study ``hold = "zero"``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Speaker = Callable[[str], str]
_speaker: ContextVar[Speaker | None] = ContextVar("speaker", default=None)
GIVEN = re.compile(
    r"(?<![\w.\-])(?P<name>[a-z][a-z0-9_]*)=(?![=>])"
    r"(?P<value>'[^']*'|\"[^\"]*\"|\[[^\]]*\]|\{[^}]*\}|\([^)]*\)|<[^>]*>|…|\.\.\.|-?[\w./]+)?"
)
"""An option with its value, as Python has it."""
OWN = r"(?<![\w=])'[^'\n]*'"
"""What a user wrote, in quotes: nothing in it is an option."""
PAIR = re.compile(r"\{'(?P<key>[^']*)': '(?P<value>[^']*)'\}")
"""One entry of a table."""
ANY = re.compile(r"…|\.\.\.|[\[{(]\W*[\]})]|<.*>|")
"""Values that stand for whatever the user will give."""
FIXED = re.compile(r"model\.with_fixed(?:\((?P<names>[^)]*)\))?")
"""How Python holds parameters."""
ANY_NAME = "NAME"
"""Stands for one of the parameters that the sentence has named."""
POWER = re.compile(r"(?<![\w.])\d(?:\.\d+)?e\+0[1-5]\b")
"""A number below a million with a power of ten, as rounding to a few digits leaves it."""

NO_CHANCE = re.compile(r"\bp = 0(?![.\d]*\d)")
"""A probability too small for the machine; none is zero."""


@contextmanager
def speaking(speaker: Speaker) -> Iterator[None]:
    """Let what is made inside say its options by `speaker`."""
    before = _speaker.set(speaker)
    try:
        yield
    finally:
        _speaker.reset(before)


def spoken(text: str) -> str:
    """A sentence with its options as they are written where the user stands, and plain numbers.

    Example
    -------
    >>> spoken("1.3e+02 standard errors")
    '130 standard errors'
    >>> spoken("halves differ (p = 0)")
    'halves differ (p < 1e-300)'
    >>> spoken("declare hold='zero'")
    "declare hold='zero'"
    >>> with speaking(as_key):
    ...     spoken("declare hold='zero', or covariance=True")
    'declare hold = "zero", or covariance = true'
    """
    speaker = _speaker.get() or str
    return speaker(NO_CHANCE.sub("p < 1e-300", POWER.sub(_plain, text)))


def _plain(number: re.Match[str]) -> str:
    return f"{float(number[0]):g}"


def held_in(text: str, place: str) -> str:
    """Python's way to hold parameters as the key of a file.

    Example
    -------
    >>> held_in("fix with model.with_fixed(Lp=..., tau=...)", "[model.parameters]")
    'fix with free = false of Lp, tau in [model.parameters]'
    """

    def key(found: re.Match[str]) -> str:
        held = re.findall(r"(\w+)=", found["names"] or "")
        names = ", ".join(name for name in held if name != ANY_NAME)
        return f"free = false{f' of {names}' if names else ''} in {place}"

    return FIXED.sub(key, text)


def replaced(options: re.Pattern[str], change: Callable[[re.Match[str]], str], text: str) -> str:
    """A text with what is an option in it changed; what a user wrote stays as it is.

    Example
    -------
    >>> replaced(GIVEN, lambda found: found["name"].upper(), "'hold=rate', declare hold='zero'")
    "'hold=rate', declare HOLD"
    """
    either = re.compile(f"(?P<own>{OWN})|{options.pattern}")
    return either.sub(lambda found: found[0] if found["own"] else change(found), text)


def as_key(text: str) -> str:
    """Options as keys of a study file."""

    def key(found: re.Match[str]) -> str:
        name, value = found["name"], found["value"] or ""
        if ANY.fullmatch(value):
            return name
        if pair := PAIR.fullmatch(value):
            return f'{name} = {{ {pair["key"]} = "{pair["value"]}" }}'
        plain = {"True": "true", "False": "false", "None": '"none"'}.get(value, value)
        return f"{name} = " + plain.replace("'", '"')

    return replaced(GIVEN, key, held_in(text, "[model.parameters]"))
