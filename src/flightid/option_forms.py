"""What the value of an option may be: told by its annotation, named in words for errors."""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Form:
    """One thing that a value may be.

    Attributes
    ----------
    words : str
        For an error and for the page of options, for example ``"a whole number"``.
    fits : callable
        Whether a value is one.
    read : callable, optional
        The value from what TOML gives, where that is another type.
    """

    words: str
    fits: Callable[[Any], bool]
    read: Callable[[Any], Any] | None = None


def _is_whole(value: object) -> bool:
    # numpy's whole numbers count, truth values do not.
    return hasattr(value, "__index__") and not isinstance(value, bool)


def _is_number(value: object) -> bool:
    if isinstance(value, bool | str) or not hasattr(value, "__float__"):
        return False
    try:
        return math.isfinite(float(value))
    except (TypeError, ValueError):
        return False


def _is_list(value: object, fits: Callable[[Any], bool], length: int | None = None) -> bool:
    if isinstance(value, str | Mapping) or not hasattr(value, "__len__"):
        return False
    items = list(typing.cast(Sequence[object], value))
    return all(map(fits, items)) and length in (None, len(items))


FLAG = Form("true or false", lambda value: isinstance(value, bool))
WHOLE = Form("a whole number", _is_whole)
NUMBER = Form("a number", _is_number, lambda value: float(value) if _is_whole(value) else value)
WORD = Form("a word", lambda value: isinstance(value, str))
NAMES = Form(
    "a list of names", lambda value: _is_list(value, lambda item: isinstance(item, str)), tuple
)
NUMBERS = Form(
    "a list of numbers", lambda value: _is_list(value, _is_number) and len(value) > 0, tuple
)
BAND = Form("two numbers, low and high", lambda value: _is_list(value, _is_number, 2), tuple)
SPAN = Form(
    "two numbers, the first below the second",
    lambda value: _is_list(value, _is_number, 2) and value[0] < value[1],
    lambda value: (float(value[0]), float(value[1])),
)
NOTHING = Form("none", lambda value: value is None)
TABLE = Form("a table", lambda value: isinstance(value, Mapping))
WORDS = Form(
    "words by name",
    lambda value: isinstance(value, Mapping) and all(isinstance(v, str) for v in value.values()),
)


def forms_of(hint: object) -> Iterable[Form]:
    """What an annotation lets a value be.

    Parameters
    ----------
    hint : type
        As `typing.get_type_hints` gives it.

    Yields
    ------
    Form

    Raises
    ------
    TypeError
        The annotation says nothing that could be checked.
    """
    simple = {bool: FLAG, int: WHOLE, float: NUMBER, str: WORD, type(None): NOTHING}
    if hint in simple:
        yield simple[hint]
        return
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        for part in parts:
            yield from forms_of(part)
    elif origin is typing.Literal:
        yield WORD
    elif isinstance(origin, type) and issubclass(origin, Mapping):
        yield WORDS if parts[1] is str else TABLE
    elif isinstance(origin, type) and issubclass(origin, Sequence):
        inner = [part for part in parts if part is not ...]
        if inner == [float, float]:
            yield BAND
        elif set(inner) <= {int, float}:
            yield NUMBERS
        else:
            yield NAMES
    else:
        raise TypeError(f"an option of type {hint} cannot be checked")
