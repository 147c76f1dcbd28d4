"""A file as columns: opened by its format, named, and with the columns that are derived of them."""

from __future__ import annotations

import csv as texts
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.dimensions import unit_of
from flightid.errors import ModelError, OptionError
from flightid.formula import RESERVED, formula_names
from flightid.record.formats import ColumnTable, FileFormat, csv, matlab, netcdf
from flightid.record.formats import parquet as parquet_format
from flightid.record.rows import column_unit


def read_table(
    path: Path,
    kind: FileFormat,
    column_names: Iterable[str],
    derive: Mapping[str, str],
    units: Mapping[str, str],
) -> ColumnTable:
    """Columns of a file of samples.

    Parameters
    ----------
    path : Path
        The file.
    kind : FileFormat
        What it is.
    column_names : iterable of str
        Names of the columns in their order, one a text or with commas between them.
    derive : mapping of str to str
        Formulas by the name of the column that they make; a later one may use those before it.
    units : mapping of str to str
        Declared units by name.

    Raises
    ------
    OptionError
        Not one name for each column; a formula outside the grammar, of columns of several
        lengths or of units that do not go together.
    UnknownNameError
        A formula names no column.
    FileFormatError, DataError
        The file cannot be read.
    """
    names = [cell.strip() for row in texts.reader(column_names) for cell in row]
    table = _opened(path, kind, names)
    for name, formula in derive.items():
        table = _derived(table, name, formula, units)
    return table


def sources_of(derive: Mapping[str, str]) -> set[str]:
    """Columns that formulas are made of.

    Raises
    ------
    ModelError
        A formula outside the grammar.
    """
    return {name for formula in derive.values() for name in formula_names(formula)}


def _opened(path: Path, kind: FileFormat, names: Sequence[str]) -> ColumnTable:
    if kind is FileFormat.CSV:
        return csv.read_columns(path, names)
    if kind is FileFormat.PARQUET:
        table = parquet_format.read_columns(path)
    elif kind is FileFormat.MATLAB:
        table = matlab.read_columns(path)
    elif kind is FileFormat.MATLAB_HDF5:
        table = matlab.read_hdf5_columns(path)
    else:
        table = netcdf.read_columns(path, classic=kind is FileFormat.NETCDF_CLASSIC)
    return table.named(names) if names else table


def _derived(table: ColumnTable, name: str, formula: str, units: Mapping[str, str]) -> ColumnTable:
    if name in table.lengths or name in RESERVED:
        raise OptionError(
            "a derived channel needs a name of its own",
            found=f"{name!r}, a column of {table.path.name} or a word of formulas",
            needed="a new name",
        )
    subject = f"derived channel {name!r}"
    try:
        sources = list(dict.fromkeys(formula_names(formula)))
        compiled = _native.Tape([formula], sources, {})
    except ModelError as fault:
        raise OptionError(
            f"{subject} is no formula: {formula!r}",
            found=str(fault),
            needed="numbers, columns, + - * / ^ and functions such as sin or where",
            action="columns whose names are no words (data.p) get others with column_names",
        ) from fault
    for source in sources:
        table.require(source)
    lengths = {table.lengths[source] for source in sources}
    if len(lengths) != 1:
        raise OptionError(
            f"{subject} has no length: {formula!r}",
            found=", ".join(f"{key}: {table.lengths[key]}" for key in sources) or "no column",
            needed="columns of one length",
        )
    derived = _FormulaColumn(table, formula, tuple(sources), compiled)
    made = derived.unit(subject, units)
    return replace(
        table,
        lengths={**table.lengths, name: lengths.pop()},
        load=lambda key: derived.values() if key == name else table.load(key),
        units=table.units if made is None else {**table.units, name: made},
    )


@dataclass(frozen=True)
class _FormulaColumn:
    """A formula of columns."""

    table: ColumnTable
    formula: str
    sources: tuple[str, ...]
    compiled: _native.Tape

    def values(self) -> NDArray[np.float64]:
        rows = np.stack([self.table.column(source) for source in self.sources], axis=1)
        return np.concatenate([self.compiled.evaluate(row) for row in rows])

    def unit(self, subject: str, units: Mapping[str, str]) -> str | None:
        """Unit of the formula; None where no column in it has any."""
        if not any(source in self.table.units or source in units for source in self.sources):
            return None
        known = {key: column_unit(self.table, key, key, units, "1") for key in self.sources}
        try:
            return unit_of(self.formula, known, subject=subject)
        except ModelError as fault:
            raise OptionError(
                str(fault.problem),
                found=fault.found,
                needed=fault.needed,
                action="declare the units of the columns in it (units), or scale one of them",
            ) from fault
