"""Formulas in model files: their names (native: `expression.rs`, `expression_tape.rs`)."""

from __future__ import annotations

from collections.abc import Iterable

from flightid import _native

FUNCTIONS = frozenset(
    ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")
) | {"abs", "sign", "atan2", "min", "max"}
FUNCTIONS |= {"where", "if", "clip", "saturation", "deadband", "and", "or", "not"}
RESERVED = FUNCTIONS | {"pi", "s"}


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
