"""Columns that formulas make of others."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.dimensions import unit_of
from flightid.errors import DataError, ModelError, OptionError
from flightid.formula import RESERVED, formula_names
from flightid.frozen import dataclass
from flightid.record.formats import ColumnTable
from flightid.record.formats.columns import channel_name
from flightid.record.rows import column_unit

OPERAND = re.compile(
    r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
    r"|(?:/\w+(?:/\w+)*|[A-Za-z_]\w*)(?:\.[A-Za-z_]\w*|\[\d+\])*"
)
"""A number, or the name of a column."""


def with_derived(
    table: ColumnTable, derive: Mapping[str, str], units: Mapping[str, str]
) -> ColumnTable:
    """A table with columns that formulas make of its own.

    A column whose name is no word (``data.p``, ``/imu/angular_velocity.x``) may stand in a formula
    between spaces, brackets or operators.

    Parameters
    ----------
    table : ColumnTable
    derive : mapping of str to str
        Formulas by the name of the column that they make; a later one may use those before it.
    units : mapping of str to str
        Declared units by name.

    Raises
    ------
    OptionError
        A formula outside the grammar, of columns of several lengths or clocks, or of units that do
        not go together.
    UnknownNameError
        A formula names no column.
    """
    for name, formula in derive.items():
        table = _derived(table, name, formula, units)
    return table


def in_words(formula: str) -> tuple[str, dict[str, str]]:
    """A formula whose columns are words, and the column of each word that is not its own name.

    Parameters
    ----------
    formula : str
        A column's name may hold points, numbers in brackets and, from its first sign on, slashes.

    Example
    -------
    >>> in_words("2*/imu/rate.x - data.p / 3")
    ('2*column_1 - column_2 / 3', {'column_1': '/imu/rate.x', 'column_2': 'data.p'})
    """
    words, columns, at = "", dict[str, str](), 0
    is_operand = True
    while at < len(formula):
        match = OPERAND.match(formula, at)
        if match is None or (formula[at] == "/" and not is_operand):
            words, at = words + formula[at], at + 1
            is_operand = is_operand if words[-1].isspace() else words[-1] != ")"
            continue
        name = match[0]
        if not (name.isidentifier() or name[0] in "0123456789."):
            name = next((word for word, column in columns.items() if column == name), "")
            name = name or f"column_{len(columns) + 1}"
            columns[name] = match[0]
        words, at, is_operand = words + name, match.end(), False
    return words, columns


def sources_of(derive: Mapping[str, str]) -> set[str]:
    """Columns that formulas are made of.

    Raises
    ------
    ModelError
        A formula outside the grammar.
    """
    found = set()
    for formula in derive.values():
        words, columns = in_words(formula)
        found |= {columns.get(name, name) for name in formula_names(words)}
    return found


def _derived(table: ColumnTable, name: str, formula: str, units: Mapping[str, str]) -> ColumnTable:
    if name in table.lengths or name in RESERVED:
        raise OptionError(
            "a derived channel needs a name of its own",
            found=f"{name!r}, a column of {table.path.name} or a word of formulas",
            needed="a new name",
        )
    subject = f"derived channel {name!r}"
    words, columns = in_words(formula)
    try:
        names = list(dict.fromkeys(formula_names(words)))
        compiled = _native.Tape([words], names, {})
    except ModelError as fault:
        raise OptionError(
            f"{subject} is no formula: {formula!r}",
            found=str(fault),
            needed="numbers, columns, + - * / ^ and functions such as sin or where",
            action="columns with other signs in their names get new ones with column_names",
        ) from fault
    sources = [columns.get(each, each) for each in names]
    sources = [table.require(source) for source in sources]
    own = table.clock
    if own is not None and len({id(own(source)) for source in sources}) > 1:
        raise OptionError(
            f"{subject} is of columns with clocks of their own: {formula!r}",
            found="; ".join(own(source).said for source in sources),
            needed="columns of one clock",
        )
    lengths = {table.lengths[source] for source in sources}
    if len(lengths) != 1:
        raise OptionError(
            f"{subject} has no length: {formula!r}",
            found=", ".join(f"{key}: {table.lengths[key]}" for key in sources) or "no column",
            needed="columns of one length",
        )
    derived = _FormulaColumn(
        name, table, formula, words, dict(zip(names, sources, strict=True)), compiled
    )
    made = derived.unit(subject, units)
    return replace(
        table,
        lengths={**table.lengths, name: lengths.pop()},
        load=lambda key: derived.values() if key == name else table.load(key),
        units=table.units if made is None else {**table.units, name: made},
        clock=own and (lambda key: own(sources[0] if key == name else key)),
    )


@dataclass(frozen=True)
class _FormulaColumn:
    """A formula of columns."""

    name: str
    table: ColumnTable
    formula: str
    words: str
    sources: Mapping[str, str]
    compiled: _native.Tape

    def values(self) -> NDArray[np.float64]:
        rows = np.stack([self.table.column(each) for each in self.sources.values()], axis=1)
        made = []
        for place, row in enumerate(rows):
            try:
                made.append(self.compiled.evaluate(row))
            except DataError as fault:
                cells = zip(self.sources.values(), row, strict=True)
                of = ", ".join(f"{column} = {value:.6g}" for column, value in cells)
                raise DataError(
                    f"derived channel {self.name!r} is not finite: {self.formula!r}",
                    found=f"{of} in row {place + 1} of {len(rows)}",
                    needed="a finite number in every row",
                    action="guard the formula, as in where(u > 0, y / u, 0), or cut those rows",
                ) from fault
        return np.concatenate(made)

    def unit(self, subject: str, units: Mapping[str, str]) -> str | None:
        """Unit of the formula; None where no column in it has any."""
        columns = self.sources.values()
        if not any(each in self.table.units or channel_name(each) in units for each in columns):
            return None
        known = {
            word: column_unit(self.table, each, channel_name(each), units, "1")
            for word, each in self.sources.items()
        }
        try:
            return unit_of(self.words, known, subject=subject)
        except ModelError as fault:
            raise OptionError(
                f"{subject} does not have its unit: {self.formula!r}",
                found=fault.found,
                needed=fault.needed,
                action="declare the units of the columns in it (units), or scale one of them",
            ) from fault
