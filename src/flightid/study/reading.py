"""Strict reading of a study file's tables: every key is a field of options, or is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, replace
from functools import partial
from typing import Any, TypeVar

from flightid.errors import StudyError
from flightid.option_forms import EACH, ONE
from flightid.options import (
    Option,
    Options,
    option_values,
    options_of,
    read_options,
    unknown_key,
)
from flightid.study.error_list import ErrorList

Made = TypeVar("Made", bound=Options)
TOP = "top level"
NUMBER = " number "


class TableReader:
    """One TOML table, whose keys are options; `finish` names what nobody took.

    Parameters
    ----------
    values : mapping
        The parsed table.
    where : str
        How the study file names it, for example ``"[response]"``.
    subject : str
        What messages call the file.
    """

    def __init__(self, values: Mapping[str, Any], where: str, subject: str = "study file") -> None:
        self._values = dict(values)
        self._where = where
        self._subject = subject
        self._known: list[str] = []

    def __contains__(self, key: str) -> bool:
        """Tell whether the table gives this key."""
        return key in self._values

    @property
    def where(self) -> str:
        """How the study file names the table."""
        return self._where

    @property
    def told(self) -> str:
        """How a message names the table."""
        return f"{self._subject}, {self._where}"

    def options(self, kind: type[Options]) -> dict[str, Any]:
        """What the table gives of a dataclass's options; those that are dataclasses are read."""
        given = {}
        for each in options_of(kind):
            self._known.append(each.name)
            if each.name in self._values:
                given[each.name] = self._value(each)
        return given

    def _value(self, each: Option) -> object:
        value, form = self._values[each.name], each.part
        if form is None or form.part is None:
            return value
        part: type[Options] = form.part
        if form.words == EACH and isinstance(value, list):
            return tuple(read_table(part, inner) for inner in self.tables(each.name))
        if not isinstance(value, dict):
            return value
        inner = self.table(each.name)
        if form.words == ONE:
            return read_table(part, inner)
        return {name: read_table(part, inner.table(name)) for name in value}

    def values(self, key: str) -> dict[str, Any]:
        """A table taken whole, for a part that checks its own keys; empty where it is absent."""
        self._known.append(key)
        value = self._values.get(key, {})
        if not isinstance(value, dict):
            raise self.error(key, "does not fit", found=value, needed="a table")
        return dict(value)

    def table(self, key: str) -> TableReader:
        """A table below; empty where it is absent."""
        return TableReader(self.values(key), self._heading(key), self._subject)

    def rows(self, key: str) -> list[tuple[str, dict[str, Any]]]:
        """A list of tables below, each with its place in words; empty where it is absent."""
        self._known.append(key)
        found, path = self._values.get(key, []), self._below(key)
        if not (isinstance(found, list) and all(isinstance(item, dict) for item in found)):
            needed = f"tables headed [[{key}]]"
            raise self.error(key, "does not fit", found=found, needed=needed)
        return [(f"[[{path}]]{NUMBER}{number}", item) for number, item in enumerate(found, start=1)]

    def tables(self, key: str) -> list[TableReader]:
        """Readers of a list of tables below; empty where it is absent."""
        return [TableReader(item, where, self._subject) for where, item in self.rows(key)]

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
            Names each key and the nearest known one.
        """
        unknown = [key for key in self._values if key not in self._known]
        collected = ErrorList(
            [unknown_key(self.told, key, self._known, StudyError) for key in unknown]
        )
        collected.finish(self._subject)

    def error(self, key: str, problem: str, *, found: object, needed: object) -> StudyError:
        """Error about one key of this table, for checks that span several keys."""
        return StudyError(f"{self.told}: {key} {problem}", found=repr(found), needed=needed)


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
        Keys that none of them has, and values that do not fit: all that are there, at once.
    """
    given = [reader.options(kind) for kind in kinds]
    collected = ErrorList()
    collected.read(reader.finish, None)
    is_known = not collected.errors
    for kind, table in zip(kinds, given, strict=True):
        for key, value in table.items():
            alone = partial(option_values, kind, {key: value}, reader.told, error=StudyError)
            collected.read(alone, None)
    if not collected.errors:
        return _made(kinds, given, reader, usual)
    # A key that is written wrong is not said to be missing beside it.
    for kind, table in zip(kinds, given, strict=True) if is_known and not any(usual) else ():
        for each in options_of(kind):
            if each.default is MISSING and each.name not in table:
                problem = f"{reader.told}: {each.name} is missing"
                collected.errors.append(StudyError(problem, needed=each.needed))
    collected.finish(reader.told.removesuffix(f", {reader.where}"))
    raise AssertionError("an error was found and not raised")


def _made(
    kinds: Sequence[type[Options]],
    given: Sequence[Mapping[str, Any]],
    reader: TableReader,
    usual: Sequence[Options | None],
) -> list[Any]:
    made = []
    for place, (kind, table) in enumerate(zip(kinds, given, strict=True)):
        base = usual[place] if place < len(usual) else None
        if base is None:
            made.append(read_options(kind, table, reader.told, error=StudyError))
        else:
            made.append(replace(base, **option_values(kind, table, reader.told, error=StudyError)))
    return made


def read_table(kind: type[Made], reader: TableReader, usual: Made | None = None) -> Made:
    """One table as one dataclass of options, which has all its keys; see `read_each`."""
    made: list[Made] = read_each((kind,), reader, (usual,))
    return made[0]


def read_own(kind: type[Made], reader: TableReader) -> Made:
    """A dataclass of options from its keys of a table; its other keys are left to others."""
    return read_options(kind, reader.options(kind), reader.told, error=StudyError)
