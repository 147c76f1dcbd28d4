"""Names and texts of a model as C sees them: never more than an identifier or a string literal."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

_KEYWORDS = frozenset(
    re.findall(
        r"\w+",
        "auto break case char const continue default do double else enum extern float for goto if "
        "inline int long register restrict return short signed sizeof static struct switch typedef "
        "union unsigned void volatile while asm fortran bool true false main errno assert",
    )
)
LONGEST = 48
"""C99 promises 63 significant characters inside a file; ours carry a prefix as well."""


def identifier(name: str, fallback: str = "model") -> str:
    """A C identifier for a name: letters, digits and underscores, at most `LONGEST` of them.

    Parameters
    ----------
    name : str
        Any text.
    fallback : str
        Put before what does not begin with a letter.

    Returns
    -------
    str

    Example
    -------
    >>> identifier('roll */ "x"'), identifier("2nd"), identifier("double")
    ('roll_x', 'model_2nd', 'model_double')
    """
    kept = re.sub(r"[^A-Za-z0-9]+", "_", name.replace("'", "_dot")).strip("_")[:LONGEST]
    if not kept:
        return fallback
    if not kept[0].isalpha() or kept in _KEYWORDS:
        return f"{fallback}_{kept}"[:LONGEST]
    return kept


def identifiers(names: Iterable[str], fallback: str = "value") -> list[str]:
    """Identifiers of several names, each its own.

    Example
    -------
    >>> identifiers(["p", "p!", "q"])
    ['p', 'p_2', 'q']
    """
    found: list[str] = []
    for name in names:
        made, count = identifier(name, fallback), 1
        while made in found:
            count += 1
            made = f"{identifier(name, fallback)}_{count}"
        found.append(made)
    return found


def text_literal(text: str) -> str:
    r"""A C string literal with the bytes of a text in UTF-8.

    Example
    -------
    >>> print(text_literal('a"b?' + chr(10)))
    "a\042b\077\012"
    """
    plain = set(range(0x20, 0x7F)) - {ord(mark) for mark in '"\\?%'}
    return '"' + "".join(chr(b) if b in plain else f"\\{b:03o}" for b in text.encode()) + '"'


def number_literal(value: float) -> str:
    """A C literal that is read back as the same double.

    Example
    -------
    >>> number_literal(0.1), number_literal(-2.0), number_literal(float("inf"))
    ('0.1', '(-2.0)', 'HUGE_VAL')
    """
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "HUGE_VAL" if value > 0 else "(-HUGE_VAL)"
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def comment(text: str) -> str:
    """Words for a C comment: nothing that ends it, continues a line or is not plain ASCII.

    Example
    -------
    >>> comment("roll */ int x;")
    'roll  / int x;'
    >>> comment("damping in lbf*s/ft"), comment("output in %"), comment("in rad/s²")
    ('damping in lbf s/ft', 'output in %', 'in rad/s^2')
    """
    plain = text.translate({ord("*"): " ", ord("²"): "^2", ord("°"): "deg", ord("·"): " "})
    return re.sub(r"[^A-Za-z0-9 .,;:=()+_'/^%-]+", "", plain)[:200]
