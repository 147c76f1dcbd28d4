"""Columns of several files on the clock of the first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from flightid.errors import DataError, OptionError
from flightid.record.clocks import Array, ClockOffset, Signal, clock_offset
from flightid.record.formats import ColumnTable, file_format
from flightid.record.formats.columns import ColumnStamps
from flightid.record.record import Record
from flightid.record.tables import read_table
from flightid.record.time_columns import USUAL, row_stamps, told_time, with_time


def with_files(
    table: ColumnTable,
    files: Sequence[str | Path | Record],
    *,
    join_on: str | None,
    clock_offset_s: float | None,
    time_column: str,
    join_time_column: str | None,
    join_time_unit: str | None,
    units: Mapping[str, str],
    sample_time_s: float | None,
) -> ColumnTable:
    """A table with the columns of files that have clocks of their own.

    Parameters
    ----------
    table : ColumnTable
    files : sequence of path or Record
        Tables, bags, or records that were read before, of a flight log for example.
    join_on, clock_offset_s
        As `joined` takes them, for each of the files.
    time_column, join_time_column : str, str or None
        Time column of the table and of the files; default: found by name and content.
    join_time_unit : str or None
        Unit of the files' stamps; default: what their heading says, else as those of the table
        where both columns have one name, else s.
    units : mapping of str to str
        Declared units, of the table's stamps too.
    sample_time_s : float or None
        Of a table without stamps.

    Raises
    ------
    OptionError
        An offset or a shared column without a file; see `joined`.
    FlightidError
        A file cannot be read, or its clock cannot be found.
    """
    if not files and (join_on is not None or clock_offset_s is not None):
        raise OptionError(
            "there is no second clock",
            found=f"join_on={join_on!r}, clock_offset_s={clock_offset_s}",
            needed="join, the file that has it",
        )
    for file in files:
        if isinstance(file, Record):
            other, named, second_s = _of_record(file), USUAL, file.time_s
        else:
            other = read_table(Path(file), file_format(Path(file)), ())
            there = join_time_column or (time_column if time_column in other.lengths else None)
            other, named = with_time(other, there, option="join_time_column")
            second_s = _stamps_to_join(other, named, join_time_unit, units, time_column)
        own = table.clock is not None
        first_s = np.empty(0) if own else row_stamps(table, time_column, units, sample_time_s)
        table = joined(
            table,
            first_s,
            other,
            second_s,
            time_columns=(time_column, named),
            join_on=join_on,
            clock_offset_s=clock_offset_s,
        )
    return table


def _stamps_to_join(
    table: ColumnTable, column: str, unit: str | None, units: Mapping[str, str], of_first: str
) -> Array:
    """Stamps of a file that joins another, s.

    Raises
    ------
    OptionError
        Their unit is told as that of a channel, or they have no such column.
    """
    if column != of_first and column in units:
        raise OptionError(
            f"{column!r} holds stamps of {table.path.name}, and is no channel",
            found=f"units={{{column!r}: {units[column]!r}}}",
            needed=f"join_time_unit={units[column]!r}",
        )
    told = unit or (None if column in table.units else units.get(column))
    return row_stamps(
        table, column, {} if told is None else {column: told}, None,
        needed="join_time_column=<name of the column>",
    )  # fmt: skip


def _of_record(record: Record) -> ColumnTable:
    """Channels of a record as columns."""
    names = dict.fromkeys(record.channels, record.n_samples)
    units = {name: record.unit(name) for name in names}
    return ColumnTable(Path(record.name or "record"), names, record.__getitem__, units)


def joined(
    first: ColumnTable,
    first_s: Array,
    second: ColumnTable,
    second_s: Array,
    *,
    time_columns: tuple[str, str],
    join_on: str | None,
    clock_offset_s: float | None,
) -> ColumnTable:
    """Columns of two files, those of the second moved to the clock of the first.

    Parameters
    ----------
    first, second : ColumnTable
        A name that both have becomes ``<file>_<name>`` in the second.
    first_s, second_s : ndarray, shape (n,)
        Stamps of tables whose columns share them, s; empty where each has its own.
    time_columns : (str, str)
        Of the first and second: they become no channels.
    join_on : str or None
        Column that both hold, whose correlation tells the offset; ``"gyro=p"`` where it has two
        names, that of the first file before that of the second.
    clock_offset_s : float or None
        Stamp on the first clock of zero on the second, in place of that.

    Raises
    ------
    OptionError
        Neither a shared column nor an offset, or both.
    DataError
        Stamps that do not rise; files without overlap; see `clock_offset`.
    """
    if (join_on is None) == (clock_offset_s is None):
        raise OptionError(
            f"the clock of {second.path.name} must be brought to that of {first.path.name} one way",
            found="neither" if join_on is None else "both",
            needed="join_on, a column that both hold, or clock_offset_s",
        )
    own_first, own_second = _stamps_of(first, first_s), _stamps_of(second, second_s)
    if join_on is not None:
        here, _, there = join_on.partition("=")
        one, two = first.require(here), second.require(there or here)
        found = clock_offset(
            _signal(first, one, own_first(one).time_s),
            _signal(second, two, own_second(two).time_s),
            join_on,
        )
    else:
        assert clock_offset_s is not None
        found = ClockOffset(clock_offset_s, 0.0, None, None, 0.0)
    names = {
        f"{second.path.stem}_{name}" if name in first.lengths else name: name
        for name in second.lengths
        if name != time_columns[1]
    }
    kept = [name for name in first.lengths if name != time_columns[0]]

    @cache
    def moved(given: ColumnStamps) -> ColumnStamps:
        time_s = found.offset_s + (1.0 + found.drift) * given.time_s
        told = filter(None, (second.path.name, told_time(second, time_columns[1])))
        return ColumnStamps(time_s, f"{', '.join(told)}: {found.said}", found.finding)

    def stamps(name: str) -> ColumnStamps:
        return moved(own_second(names[name])) if name in names else own_first(name)

    return ColumnTable(
        first.path,
        {name: first.lengths[name] for name in kept}
        | {new: second.lengths[old] for new, old in names.items()},
        lambda name: second.load(names[name]) if name in names else first.load(name),
        {
            **first.units,
            **{n: second.units[old] for n, old in names.items() if old in second.units},
        },
        first.advice,
        stamps,
    )


def _stamps_of(table: ColumnTable, shared: Array) -> Callable[[str], ColumnStamps]:
    """Stamps by column, of a table whose columns share them too."""
    if table.clock is not None:
        return table.clock
    common = ColumnStamps(shared, f"{table.path.name}: its own stamps")
    return lambda _: common


def _signal(table: ColumnTable, name: str, time_s: Array) -> Signal:
    """Stamps and samples of a column that are there.

    Raises
    ------
    DataError
        Stamps that do not rise.
    """
    values = table.column(name)
    there = np.isfinite(values) & np.isfinite(time_s)
    time_s, values = time_s[there], values[there]
    if time_s.size < 2 or not np.all(np.diff(time_s) > 0):
        raise DataError(
            f"stamps of {table.path.name} do not rise",
            needed="rising stamps, to join another file by them",
        )
    return time_s, values
