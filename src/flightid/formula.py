"""Formulas in model files: their names (native: `expression.rs`, `expression_tape.rs`)."""

from __future__ import annotations

import re
from collections.abc import Iterable

from flightid import _native
from flightid.errors import ModelError

FUNCTIONS = frozenset(
    ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")
) | {"abs", "sign", "atan2", "min", "max"}
FUNCTIONS |= {"where", "if", "clip", "saturation", "deadband", "and", "or", "not"}
RESERVED = FUNCTIONS | {"pi", "s"}
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def require_name(name: str, subject: str) -> None:
    """Refuse what a formula cannot name.

    Parameters
    ----------
    name : str
    subject : str
        What bears it, such as "a parameter".

    Raises
    ------
    ModelError
        No name, or that of a function or constant.

    Example
    -------
    >>> require_name("zeta_1", "a parameter")
    """
    if not NAME.fullmatch(name) or name in RESERVED:
        raise ModelError(
            f"name of {subject} cannot stand in a formula",
            found=repr(name),
            needed="letters, digits and underscores, not a function, 'pi' or 's'",
        )


def formula_names(text: str, tables: Iterable[str] = ()) -> list[str]:
    """Names that occur in a formula, in order.

    Parameters
    ----------
    text : str
        Formula in the grammar of model files.
    tables : iterable of str
        Names of the tables that it may call.

    Returns
    -------
    list of str

    Raises
    ------
    ModelError
        The text is outside the grammar; the message gives the place.

    Example
    -------
    >>> formula_names("2*zeta*omega + sin(a)^2")
    ['zeta', 'omega', 'a']
    """
    return _native.expression_names(text, list(tables))
