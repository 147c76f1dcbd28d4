"""What the value of an option may be: told by its annotation, named in words for errors."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from flightid.frozen import dataclass


@dataclass(frozen=True, eq=False)
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
    part : type, optional
        Dataclass of options that a table, or each of several tables, is read into.
    """

    words: str
    fits: Callable[[Any], bool]
    read: Callable[[Any], Any] | None = None
    part: type | None = None


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


def _floats(value: Iterable[Any]) -> tuple[float, ...]:
    return tuple(map(float, value))


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
TRIPLE = Form("three numbers", lambda value: _is_list(value, _is_number, 3), _floats)
WHOLES = Form(
    "a list of whole numbers", lambda value: _is_list(value, _is_whole) and len(value) > 0, tuple
)
SPAN = Form(
    "two numbers, the first below the second",
    lambda value: _is_list(value, _is_number, 2) and value[0] < value[1],
    _floats,
)
NOTHING = Form("none", lambda value: value is None)
TABLE = Form("a table", lambda value: isinstance(value, Mapping))
WORDS = Form(
    "words by name",
    lambda value: isinstance(value, Mapping) and all(isinstance(v, str) for v in value.values()),
)
FIGURES = Form(
    "numbers by name",
    lambda value: isinstance(value, Mapping) and all(map(_is_number, value.values())),
    lambda value: {name: float(number) for name, number in value.items()},
)
LISTS = Form(
    "lists of names by name",
    lambda value: (
        isinstance(value, Mapping)
        and all(WORD.fits(names) or NAMES.fits(names) for names in value.values())
    ),
    lambda value: {name: (v,) if WORD.fits(v) else tuple(v) for name, v in value.items()},
)
FIGURE_TABLES = Form(
    "tables of numbers by name",
    lambda value: isinstance(value, Mapping) and all(map(FIGURES.fits, value.values())),
    lambda value: {name: dict(figures) for name, figures in value.items()},
)
TABLES = Form("a list of tables", lambda value: _is_list(value, TABLE.fits), tuple)
_BY_NAME: dict[object, Form] = {
    str: WORDS,
    float: FIGURES,
    tuple[str, ...]: LISTS,
    Mapping[str, float]: FIGURE_TABLES,
}
ONE, EACH, NAMED = "a table of its own", "tables of their own", "a table of its own by name"


def part_of(kind: type, words: str) -> Form:
    """A dataclass of options within another: one table, a list of them, or one for each name.

    Parameters
    ----------
    kind : type
    words : str
        One of `ONE`, `EACH` and `NAMED`.
    """
    inside: dict[str, Callable[[Any], Iterable[object]]] = {
        ONE: lambda value: (value,),
        EACH: lambda value: value if isinstance(value, tuple) else (None,),
        NAMED: lambda value: value.values() if isinstance(value, Mapping) else (None,),
    }

    def fits(value: object) -> bool:
        return all(isinstance(item, kind) for item in inside[words](value))

    return Form(words, fits, part=kind)


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
    if dataclasses.is_dataclass(hint):
        yield part_of(typing.cast(type, hint), ONE)
        return
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        for part in parts:
            yield from forms_of(part)
    elif origin is typing.Literal:
        yield WORD
    elif isinstance(origin, type) and issubclass(origin, Mapping):
        is_part = dataclasses.is_dataclass(parts[1])
        yield part_of(parts[1], NAMED) if is_part else _BY_NAME.get(parts[1], TABLE)
    elif isinstance(origin, type) and issubclass(origin, Sequence):
        yield _form_of_list([part for part in parts if part is not ...])
    else:
        raise TypeError(f"an option of type {hint} cannot be checked")


def _form_of_list(inner: list[Any]) -> Form:
    """What a list of these may be; one type stands for any number of them."""
    if dataclasses.is_dataclass(inner[0]):
        return part_of(typing.cast(type, inner[0]), EACH)
    if typing.get_origin(inner[0]) is Mapping:
        return TABLES
    if inner in ([float] * 2, [float] * 3):
        return BAND if len(inner) == len(("low", "high")) else TRIPLE
    if inner == [int]:
        return WHOLES
    return NUMBERS if {*inner} <= {int, float} else NAMES
