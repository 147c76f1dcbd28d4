"""What every result can do: plain values, tables, a fragment of HTML, a picture."""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from enum import Enum
from importlib import import_module
from inspect import get_annotations
from pathlib import PurePath
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from flightid.errors import OptionError
from flightid.table import Table

if TYPE_CHECKING:
    from flightid.findings import Finding

ABSENT = "absent"
"""Key that says why a value of `to_dict` is None, by the way to it."""
WHOLE = frozenset({bool, int, type(None)})
PLAIN = frozenset({str, bool, int, float, type(None)})


class TableView(ABC):
    """Anything that shows itself as tables: on a terminal by `summary`, in a notebook as HTML.

    Example
    -------
    >>> class Gain(TableView):
    ...     def summary(self) -> Table:
    ...         return Table("Gain", (), ())
    >>> Gain()._repr_html_().startswith("<table>")
    True
    """

    @abstractmethod
    def summary(self) -> Table:
        """Its numbers in one table."""

    def _tables(self) -> tuple[Table, ...]:
        """All tables that a notebook shows; by default the summary alone."""
        return (self.summary(),)

    def _repr_html_(self) -> str:
        return "".join(table._repr_html_() for table in self._tables())


class Result(TableView):
    """Base of every result; a class says its schema, and which fields it does not tell.

    ``class Found(Result, schema="flightid.found/1", untold={"record": "raw samples"})``.

    Example
    -------
    >>> @dataclasses.dataclass(frozen=True)
    ... class Root(Result, schema="flightid.root/1"):
    ...     eigenvalue: complex
    ...     period_s: float
    ...     def summary(self) -> Table:
    ...         return Table("Root", (), ())
    >>> Root(-1 + 2j, math.inf).to_dict()
    {'schema': 'flightid.root/1', 'eigenvalue': [-1.0, 2.0], 'period_s': None,
     'absent': {'period_s': 'infinite'}}
    """

    schema: ClassVar[str] = ""
    untold: ClassVar[Mapping[str, str]] = MappingProxyType({})

    if TYPE_CHECKING:

        @property
        def findings(self) -> tuple[Finding, ...]:
            """Verdicts with what to do; empty where it has none."""
            return ()

    def __init_subclass__(
        cls, *, schema: str = "", untold: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """Note the schema and the fields that are not told; absent, those of the class above."""
        super().__init_subclass__()
        if schema:
            cls.schema = schema
        if untold:
            cls.untold = MappingProxyType({**cls.untold, **untold})
        has_findings = any("findings" in get_annotations(each) for each in cls.mro())
        if not has_findings and not hasattr(cls, "findings"):
            cls.findings = ()  # type: ignore[assignment, method-assign]  # a property by default

    def settings_tables(self) -> tuple[Table, ...]:
        """Tables of what was set otherwise, beside the summary; by default none."""
        return ()

    def _computed(self) -> dict[str, object]:
        """Values computed from the fields, by key; one that has a field's name replaces it."""
        return {}

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for strict JSON.

        Returns
        -------
        dict
            ``schema``, every field under its name but those in `untold`, and what is computed from
            them. Arrays are lists, complex numbers ``[real, imaginary]``; a number that is not
            finite is None, and ``absent`` says why by the way to it.
        """
        values = {key: value for key, value in _values(self).items() if key not in self.untold}
        absent: dict[str, str] = {}
        told = _plain({**values, **self._computed()}, "", absent)
        return {"schema": self.schema, **told, **({ABSENT: absent} if absent else {})}

    def plot(self, **options: object) -> Any:  # noqa: ANN401 — only plot knows its type
        """Draw it.

        Parameters
        ----------
        **options
            Of the function of `flightid.plot` that draws this kind of result.

        Returns
        -------
        Figure

        Raises
        ------
        OptionError
            There is no picture of this kind of result.

        Example
        -------
        >>> import flightid as fid
        >>> record = fid.Record.from_arrays([0.0, 0.1], outputs={"p": [0.0, 0.2]})
        >>> type(record.plot()).__name__
        'PlotFigure'
        """
        return _drawing(type(self))(self, **options)


def _plain(value: object, way: str, absent: dict[str, str]) -> Any:  # noqa: ANN401 — plain values
    """Value as JSON holds it; `absent` takes what no JSON number can say."""
    if _says_itself(value):  # nearly all: neither its way nor its kind need be found out
        return value
    if _is_plain_array(value):
        return value.tolist()  # type: ignore[attr-defined]  # thousands of numbers at once
    value = value if type(value) in PLAIN else _opened(value)
    if isinstance(value, float) and not math.isfinite(value):
        absent[way] = "not determined" if math.isnan(value) else "infinite"
        return None
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Mapping):
        return {
            str(key): item if _says_itself(item) else _plain(item, _step(way, key), absent)
            for key, item in value.items()
        }
    if isinstance(value, Sequence | set | frozenset) and not isinstance(value, str | bytes):
        return [
            item if _says_itself(item) else _plain(item, f"{way}[{i}]", absent)
            for i, item in enumerate(value)
        ]
    raise TypeError(f"{way} is a {type(value).__name__}, which has no plain values")


def _says_itself(value: object) -> bool:
    """Whether it is, itself and no subclass of it, what JSON can say."""
    kind = type(value)
    return kind is str or (kind is float and math.isfinite(value)) or kind in WHOLE  # type: ignore[arg-type]  # narrowed by its very type


def _is_plain_array(value: object) -> bool:
    """Whether it is an array of real numbers that JSON can say, every one."""
    if not isinstance(value, np.ndarray):
        return False
    return value.dtype.kind in "biu" or (value.dtype.kind == "f" and bool(np.isfinite(value).all()))


def _values(thing: object) -> dict[str, object]:
    """Fields of a dataclass by name, those of its own use left out; empty of anything else."""
    kinds = getattr(thing, "__dataclass_fields__", {})
    names = [each.name for each in dataclasses.fields(thing)] if kinds else []  # type: ignore[arg-type]
    return {name: getattr(thing, name) for name in names if not name.startswith("_")}


def _opened(value: object) -> object:
    """A number, word, list or mapping in place of what wraps it."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, complex):
        return (value.real, value.imag)
    if isinstance(value, PurePath):
        return str(value)
    if hasattr(value, "to_dict"):
        return value.to_dict()
    return _values(value) if dataclasses.is_dataclass(value) else value


def _step(way: str, key: object) -> str:
    return f"{way}.{key}" if way else str(key)


def _drawing(kind: type) -> Any:  # noqa: ANN401 — a function of the module that plot names
    """Function of `flightid.plot` that draws a kind of result."""
    pictures: Mapping[str, Any] = import_module("flightid.plot.pictures").PICTURES
    for each in kind.mro():
        if each.__name__ in pictures:
            return pictures[each.__name__]
    raise OptionError(
        f"{kind.__name__} has no picture",
        needed="a result of one of " + ", ".join(sorted(pictures)),
        action="show its summary()",
    )
