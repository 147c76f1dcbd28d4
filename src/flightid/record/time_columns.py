"""Which column of a table is its time: the one that is named, else by name and content."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from flightid.errors import OptionError, UnitError
from flightid.record.formats import ColumnTable
from flightid.record.formats.columns import channel_name, is_unit
from flightid.record.rows import column_unit, manoeuvres
from flightid.record.stamps import mean_spacing_s
from flightid.units import canonical, convert, same_dimension

USUAL = "time"
"""A column of this name is the time, whatever else there is."""
TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
GLUED = re.compile(r"(time|timestamp)(ns|us|usec|ms|msec|s|sec)")
TIMES = frozenset(
    {"t", "time", "timestamp", "timestamps", "stamp", "elapsed", "uptime", "zeit", "zeitstempel",
     "temps", "tiempo", "tempo"}
)  # fmt: skip
"""Words for time, in English, German, French, Spanish and Italian."""
BESIDE = frozenset(
    {"abs", "absolute", "boot", "epoch", "log", "rel", "relative", "run", "sample", "sim", "since",
     "start"}
)  # fmt: skip
"""Words that stand beside those."""
SPELLED = {
    "millis": "ms", "micros": "us", "nanos": "ns", "msecs": "ms", "usecs": "us", "sekunden": "s",
    "secondes": "s", "segundos": "s",
}  # fmt: skip
ALONE = frozenset(
    {*SPELLED, "sec", "secs", "second", "seconds", "ms", "msec", "us", "usec", "ns", "nsec"}
)
"""Units that are the name of a time without another word."""
MOST_NAMES = 12
"""Of columns that a refusal lists; of more their count says what kind of file it is."""
SAME = 0.05
"""Part of the spacing to which stamps of two columns agree that tell one time."""


def unit_in_name(name: str) -> str | None:
    """Unit that the name of a column of times says; "" where it says none, None for no such name.

    Example
    -------
    >>> unit_in_name("TimeUS"), unit_in_name("Time (s)"), unit_in_name("t_ms")
    ('us', 's', 'ms')
    >>> unit_in_name("elapsed"), unit_in_name("time_of_flight"), unit_in_name("temperature")
    ('', None, None)
    """
    text = GLUED.sub(r"\1 \2", name.replace("µ", "u").replace("μ", "u"))
    words = [word.lower() for word in TOKEN.findall(text)]
    parted = " ".join(words)
    words = GLUED.sub(r"\1 \2", parted).split()
    units = [word for word in words if word not in TIMES | BESIDE]
    is_time = bool(TIMES & {*words}) or (len(words) == 1 and words[0] in ALONE)
    if units[:-1] == ["in"]:
        del units[0]  # "Time in ms", "Zeit in s"
    if not is_time or len(units) > 1:
        return None
    unit = SPELLED.get(units[0], units[0]) if units else ""
    return unit if not unit or is_time_unit(unit) else None


def is_time_unit(unit: str) -> bool:
    """Whether a text is a unit of time."""
    return is_unit(unit) and same_dimension(canonical(unit), "s")


def with_time(
    table: ColumnTable,
    asked: str | None,
    taken: Container[str] = (),
    *,
    record: str | None = None,
    option: str = "time_column",
) -> tuple[ColumnTable, str]:
    """A table with the unit of its time, as the column's name says it, and that column.

    Parameters
    ----------
    table : ColumnTable
        With columns that share their stamps.
    asked : str or None
        The column, where it was named; it need not be there.
    taken : container of str
        Columns that are channels by name.
    record : str or None
        Column that tells manoeuvres apart: time may start again with each.
    option : str
        That names the column.

    Raises
    ------
    OptionError
        Several columns may be the time, and tell different ones.
    """
    if table.clock is not None:
        return table, asked or USUAL
    if asked and asked not in table.lengths and channel_name(asked) in table.lengths:
        asked = channel_name(asked)
    name = asked or (USUAL if USUAL in table.lengths else _found(table, taken, record, option))
    unit = unit_in_name(name) if name in table.lengths and name not in table.units else None
    return (replace(table, units={**table.units, name: unit}) if unit else table), name


def _found(table: ColumnTable, taken: Container[str], record: str | None, option: str) -> str:
    named = [name for name in table.lengths if name not in taken and _doubt_of(table, name) == ""]
    rising = [name for name in named if not fault_of_time(table, name, record)]
    if not rising:
        return USUAL
    first, *others = sorted(rising, key=lambda name: not _unit(table, name))
    if differing := [name for name in others if not _same(table, first, name)]:
        raise OptionError(
            f"{table.path.name} has several columns that may be its time",
            found=", ".join(_told(table, name) for name in (first, *differing)),
            needed=f"{option}=<name of the column>",
        )
    return first


def _doubt_of(table: ColumnTable, name: str) -> str | None:
    """What its unit speaks against a column that is named as a time; None: it is not."""
    if unit_in_name(name) is None:
        return None
    unit = table.units.get(name)
    return "" if unit is None or is_time_unit(unit) else f"its unit is {unit}"


def fault_of_time(table: ColumnTable, name: str, record: str | None) -> str:
    """Why a column of such a name is no time: it has to rise strictly; empty where it does."""
    values = table.raw(name)
    if values.dtype.kind not in "fiu":
        return f"it holds text such as {str(values[0])!r}" if values.size else "it is empty"
    if sum(length == values.size for length in table.lengths.values()) == 1:
        return "no other column is as long"
    label = record if record in table.lengths else None
    for part, _ in manoeuvres(table, label, np.asarray(values, np.float64), split_gaps=False):
        steps = np.diff(values[part].astype(np.float64))
        back = np.flatnonzero(~(steps > 0))
        if back.size:
            return f"it does not rise from row {part.start + int(back[0]) + 1} to the next"
    return "" if values.size > 1 else "it has one row"


def _unit(table: ColumnTable, name: str) -> str:
    return table.units.get(name) or unit_in_name(name) or ""


def _same(table: ColumnTable, one: str, two: str) -> bool:
    """Whether two columns tell the same time but for where it begins."""
    if table.lengths[one] != table.lengths[two]:
        return False
    stamps = [
        convert(table.column(name), canonical(_unit(table, name) or "s"), "s")
        for name in (one, two)
    ]  # fmt: skip
    apart = np.ptp(stamps[0] - stamps[1])
    return bool(apart <= SAME * abs(mean_spacing_s(stamps[0])))


def _told(table: ColumnTable, name: str) -> str:
    values = table.column(name)
    unit = _unit(table, name)
    return f"{name!r} ({values[0]:.6g} to {values[-1]:.6g}{f' {unit}' if unit else ''})"


def row_stamps(
    table: ColumnTable,
    time_column: str,
    units: Mapping[str, str],
    sample_time_s: float | None,
    *,
    needed: str = "time_column=<name of the column> or sample_time_s=<seconds>",
) -> NDArray[np.float64]:
    """Time of each row, s, from the column of the stamps or from a stated sample time.

    Columns with stamps of their own have none in common: it is empty.

    Raises
    ------
    OptionError
        Time stated twice, or not at all.
    UnitError
        A unit of the column that is none of time.
    """
    if table.clock is not None:
        if sample_time_s is not None:
            raise OptionError(
                f"the columns of {table.path.name} have stamps",
                found=f"sample_time_s={sample_time_s}",
                needed="no sample time; resample_to_s is that of the new grid",
            )
        return np.empty(0)
    if time_column in table.lengths:
        if sample_time_s is not None:
            raise OptionError(
                "the time is stated twice",
                found=f"column {time_column!r} and sample_time_s={sample_time_s}",
                needed="one of them",
                action="leave out sample_time_s, or name another time_column",
            )
        unit = column_unit(table, time_column, time_column, units, default="s")
        if not same_dimension(unit, "s"):
            raise UnitError(
                f"the unit of the time column {time_column!r} is none of time",
                found=unit,
                needed="s, ms, us, min …",
            )
        values = table.column(time_column)
        return values if unit == "s" else convert(values, unit, "s")
    if sample_time_s is None:
        raise OptionError(
            f"{table.path.name} has no time column {time_column!r}",
            found=_columns(table),
            needed=needed,
            action=near_times(table)
            or table.advice
            or "say it, for none is invented: sample_time_s=…",
        )
    if not (np.isfinite(sample_time_s) and sample_time_s > 0):
        raise OptionError("sample time is not positive", found=sample_time_s, needed="above 0 s")
    longest = max(table.lengths.values(), default=0)
    return np.asarray(sample_time_s * np.arange(longest), dtype=np.float64)


def _columns(table: ColumnTable) -> str:
    """Names of columns; of many their count and the first ones."""
    names = list(table.lengths)
    if len(names) <= MOST_NAMES:
        return "columns " + ", ".join(names)
    return f"{len(names)} columns, {', '.join(names[: MOST_NAMES // 2])}, …"


def with_time_unit(
    units: Mapping[str, str], time_column: str, time_unit: str | None
) -> Mapping[str, str]:
    """Declared units with that of the stamps.

    Raises
    ------
    OptionError
        It is declared twice, and differently.
    """
    said = units.get(time_column, time_unit)
    if time_unit is None or said is None:
        return units
    if said != time_unit:
        raise OptionError(
            "the unit of the time is declared twice",
            found=f"time_unit = {time_unit!r}, units {time_column} = {said!r}",
            needed="one of them",
        )
    return {**units, time_column: time_unit}


def told_time(
    table: ColumnTable, name: str, units: Mapping[str, str] = MappingProxyType({})
) -> str:
    """The column of the time with its unit, in words, where it is not the usual one; else empty.

    Example
    -------
    >>> from pathlib import Path
    >>> told_time(ColumnTable(Path("a.csv"), {"t": 2}, np.zeros), "t", {"t": "ms"})
    "time from column 't' (ms)"
    """
    if name == USUAL or name not in table.lengths:
        return ""
    unit = units.get(name) or _unit(table, name)
    return f"time from column {name!r} ({unit or 's, as nothing says otherwise'})"


def near_times(table: ColumnTable, record: str | None = None) -> str:
    """What is named as a time and is none, with the reason; empty where nothing is."""
    return "; ".join(_near(table, record))


def _near(table: ColumnTable, record: str | None) -> Iterator[str]:
    for name in table.lengths:
        doubt = _doubt_of(table, name)
        if doubt is not None:
            yield f"{name!r} is no time: {doubt or fault_of_time(table, name, record)}"
