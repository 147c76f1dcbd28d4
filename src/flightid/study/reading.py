"""Strict reading of a study file's tables: every key is asked for, typed and accounted for."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Any, TypeVar, cast

from flightid.errors import StudyError
from flightid.options import Options, options_of, read_options

Value = TypeVar("Value")
TOP = "top level"
NUMBER = " number "
REQUIRED: Any = object()
"""Default of a key that must be given."""


class TableReader:
    """One TOML table whose keys are taken one by one; `finish` names what nobody took.

    Parameters
    ----------
    values : mapping
        The parsed table.
    where : str
        How the study file names it, for example ``"[response]"``.
    """

    def __init__(self, values: Mapping[str, Any], where: str) -> None:
        self._values = dict(values)
        self._where = where
        self._known: list[str] = []

    def __contains__(self, key: str) -> bool:
        """Tell whether the table gives this key."""
        return key in self._values

    @property
    def where(self) -> str:
        """How the study file names the table."""
        return self._where

    def peek(self, key: str) -> object:
        """A value as the file gives it."""
        return self._values[key]

    def rest(self) -> dict[str, Any]:
        """All values that nobody asked for, for a part that checks its own keys."""
        left = {key: value for key, value in self._values.items() if key not in self._known}
        self._known += list(left)
        return left

    def text(self, key: str, default: str = REQUIRED) -> str:
        """One string."""
        return str(self._take(key, default, lambda value: isinstance(value, str), "a text"))

    def flag(self, key: str, default: bool = REQUIRED) -> bool:
        """One truth value."""
        return bool(
            self._take(key, default, lambda value: isinstance(value, bool), "true or false")
        )

    def choice(self, key: str, options: Iterable[str], default: str = REQUIRED) -> str:
        """One of several words."""
        words = tuple(options)
        needed = "one of " + ", ".join(map(repr, words))
        return str(self._take(key, default, lambda value: value in words, needed))

    def integer(self, key: str, default: int = REQUIRED, *, minimum: int = 0) -> int:
        """One whole number from a minimum on."""

        def fits(value: object) -> bool:
            return isinstance(value, int) and not isinstance(value, bool) and value >= minimum

        return int(self._take(key, default, fits, f"a whole number from {minimum} on"))

    def integers(
        self, key: str, default: Iterable[int] | None = None, *, word: str = ""
    ) -> tuple[int, ...]:
        """Different whole numbers from 0 on, or one alone; none where a word stands for them."""

        def fits(value: object) -> bool:
            listed = value if isinstance(value, list) else [value]
            whole = all(
                isinstance(item, int) and not isinstance(item, bool) and item >= 0
                for item in listed
            )
            return value == word != "" or (
                whole and bool(listed) and len(set(listed)) == len(listed)
            )

        usual = REQUIRED if default is None else default
        instead = f", or {word!r}" if word else ""
        needed = f"a whole number from 0 on, or a list of them{instead}"
        found = self._take(key, usual, fits, needed)
        found = () if isinstance(found, str) else found
        return (found,) if isinstance(found, int) else tuple(found)

    def number(self, key: str, default: float = REQUIRED) -> float:
        """One finite number."""
        return float(self._take(key, default, _is_number, "a number"))

    def positive(self, key: str, default: float = REQUIRED) -> float:
        """One finite number above zero."""
        return float(
            self._take(
                key, default, lambda value: _is_number(value) and value > 0, "a number above 0"
            )
        )

    def maybe(self, read: Callable[[str], Value], key: str) -> Value | None:
        """What `read` makes of a key, or None where it is absent."""
        self._known.append(key)
        return read(key) if key in self._values else None

    def names(self, key: str, default: Iterable[str] = REQUIRED) -> tuple[str, ...]:
        """Several strings, each once; one string alone may stand for a list of one."""

        def fits(value: object) -> bool:
            listed = [value] if isinstance(value, str) else value
            return (
                isinstance(listed, list)
                and all(isinstance(item, str) for item in listed)
                and len(set(listed)) == len(listed)
            )

        found = self._take(key, default, fits, "a list of different texts")
        return (found,) if isinstance(found, str) else tuple(found)

    def several(
        self, key: str, fits: Callable[[Any], bool], needed: str, default: Iterable[Any] = REQUIRED
    ) -> tuple[Any, ...]:
        """Different values that each fit; one alone may stand for a list of one."""

        def each_fits(value: object) -> bool:
            listed = value if isinstance(value, list) else [value]
            return bool(listed) and all(map(fits, listed)) and len(set(listed)) == len(listed)

        found = self._take(key, default, each_fits, f"{needed}, or a list of them")
        return tuple(found) if isinstance(found, list | tuple) else (found,)

    def numbers(
        self, key: str, default: Iterable[float] = REQUIRED, *, length: int | None = None
    ) -> tuple[float, ...]:
        """Several finite numbers: of a given count, or at least one, which may stand alone."""

        def fits(value: object) -> bool:
            listed = [value] if length is None and _is_number(value) else value
            return (
                isinstance(listed, list)
                and (len(listed) == length if length else bool(listed))
                and all(map(_is_number, listed))
            )

        needed = f"a list of {length or 'one or more'} numbers"
        found = self._take(key, default, fits, needed)
        return tuple(map(float, [found] if _is_number(found) else found))

    def interval(self, key: str) -> tuple[float, float]:
        """Two finite numbers, the first below the second."""

        def fits(value: object) -> bool:
            return (
                isinstance(value, list)
                and len(value) == 2
                and all(map(_is_number, value))
                and value[0] < value[1]
            )

        found = self._take(key, REQUIRED, fits, "two numbers, the first below the second")
        return float(found[0]), float(found[1])

    def values(self, key: str) -> dict[str, Any]:
        """A table taken whole, for a part that checks its own keys; empty where it is absent."""
        return dict(self._take(key, {}, lambda value: isinstance(value, dict), "a table"))

    def table(self, key: str) -> TableReader:
        """A table below; empty where it is absent."""
        return TableReader(self.values(key), self._heading(key))

    def rows(self, key: str) -> list[tuple[str, dict[str, Any]]]:
        """A list of tables below, each with its place in words; empty where it is absent."""

        def fits(value: object) -> bool:
            return isinstance(value, list) and all(isinstance(item, dict) for item in value)

        found = self._take(key, [], fits, f"tables headed [[{key}]]")
        path = self._below(key)
        return [(f"[[{path}]]{NUMBER}{number}", item) for number, item in enumerate(found, start=1)]

    def tables(self, key: str) -> list[TableReader]:
        """Readers of a list of tables below; empty where it is absent."""
        return [TableReader(item, where) for where, item in self.rows(key)]

    def know(self, key: str) -> None:
        """Count a key as one that has a meaning here, though it is absent."""
        self._known.append(key)

    def _heading(self, key: str) -> str:
        """How a table below is named: under one of several by its place."""
        if NUMBER in self._where:
            return f"{self._where}, {key}"
        return f"[{self._below(key)}]"

    def _below(self, key: str) -> str:
        return key if self._where == TOP else f"{re.sub(r'[][]', '', self._where)}.{key}"

    def finish(self) -> None:
        """Refuse keys that nobody asked for.

        Raises
        ------
        StudyError
            Names the key and the nearest known one.
        """
        for key in self._values:
            if key not in self._known:
                raise unknown_key(self._where, key, self._known)

    def error(self, key: str, problem: str, *, found: object, needed: object) -> StudyError:
        """Error about one key of this table, for checks that span several keys."""
        return StudyError(
            f"study file, {self._where}: {key} {problem}", found=repr(found), needed=needed
        )

    def _take(  # any TOML value; its type is what `fits` has checked
        self, key: str, default: object, fits: Callable[[Any], bool], needed: str
    ) -> Any:  # noqa: ANN401
        self._known.append(key)
        if key not in self._values:
            if default is REQUIRED:
                raise StudyError(f"study file, {self._where}: {key} is missing", needed=needed)
            return default
        value = self._values[key]
        if not fits(value):
            raise self.error(key, "does not fit", found=value, needed=needed)
        return value


def read_each(
    kinds: Sequence[type[Options]], reader: TableReader, usual: Sequence[Options | None] = ()
) -> list[Any]:
    """One table as several dataclasses of options; what it does not say is as usual.

    Parameters
    ----------
    kinds : sequence of type
        Dataclasses whose options are the table's keys.
    reader : TableReader
    usual : sequence of Options, optional
        In place of their defaults.

    Returns
    -------
    list of Options
        One for each dataclass.

    Raises
    ------
    StudyError
        A key that none of them has, or a value that does not fit.
    """
    where = f"study file, {reader.where}"
    given = reader.rest()
    names = [[each.name for each in options_of(kind)] for kind in kinds]
    for key in given:
        if not any(key in known for known in names):
            raise unknown_key(reader.where, key, dict.fromkeys(n for known in names for n in known))
    made = []
    for place, (kind, known) in enumerate(zip(kinds, names, strict=True)):
        table = {key: value for key, value in given.items() if key in known}
        found = read_options(kind, table, where, error=StudyError)
        base = usual[place] if place < len(usual) else None
        if base is not None:
            found = replace(base, **{key: getattr(found, key) for key in table})
        made.append(found)
    return made


def unknown_key(where: str, key: str, known: Iterable[str]) -> StudyError:
    """Error for a key that has no meaning here; names the nearest one that has."""
    options = list(dict.fromkeys(known))
    near = get_close_matches(key, options, n=1, cutoff=0.5)
    return StudyError(
        f"study file, {where}: there is no key {key!r}",
        needed="one of " + ", ".join(options) if options else "no key at all",
        action=f"write {near[0]!r}" if near else None,
    )


def _is_number(value: object) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(cast(float, value))
    )
