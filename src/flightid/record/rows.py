"""Rows of a table of samples: their time, their units, and where one manoeuvre ends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FileFormatError, OptionError, UnitError
from flightid.record.formats import ColumnTable
from flightid.record.formats.columns import is_unit
from flightid.record.stamps import GAP_FACTOR
from flightid.units import canonical, convert, same_dimension

MOST_SAMPLES_PER_ROW = 10
"""A new base that makes as many samples of a row invents them: the unit of the time is wrong."""


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
            found="columns " + ", ".join(table.lengths),
            needed=needed,
            action=_looks_like_time(table)
            or table.advice
            or "no sample time is invented: state it",
        )
    if not (np.isfinite(sample_time_s) and sample_time_s > 0):
        raise OptionError("sample time is not positive", found=sample_time_s, needed="above 0 s")
    longest = max(table.lengths.values(), default=0)
    return np.asarray(sample_time_s * np.arange(longest), dtype=np.float64)


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


def _looks_like_time(table: ColumnTable) -> str:
    near = [name for name in table.lengths if name.lower() == "t" or name.lower()[:4] == "time"]
    return f"{near[0]!r} looks like the time: name it as that" if near else ""


def column_unit(
    table: ColumnTable, column: str, name: str, units: Mapping[str, str], default: str
) -> str:
    """Unit of a column: what is declared, else what the file says.

    Raises
    ------
    UnitError
        A unit that is not known.
    """
    stated, declared = table.units.get(column), units.get(name)
    if declared is None:
        if stated is not None and not is_unit(stated):
            raise UnitError(
                f"the unit of column {column!r} is not known",
                found=repr(stated),
                needed=f"units={{{name!r}: ...}}, the unit declared",
            )
        return canonical(stated) if stated is not None else default
    return canonical(declared)


def manoeuvres(
    table: ColumnTable, record: str | None, stamps: NDArray[np.float64], *, split_gaps: bool
) -> list[tuple[slice, str | None]]:
    """Row ranges of the manoeuvres and their names, where the file has them.

    A manoeuvre ends where the column `record` changes, where time starts again, and, with
    `split_gaps`, where it has a gap.
    """
    edges = {0, stamps.size}
    labels = None
    if record is not None and record in table.lengths:
        labels = table.raw(record)
        if labels.size != stamps.size:
            raise FileFormatError(
                f"column {record!r} is not as long as the time",
                found=f"{labels.size} samples",
                needed=f"{stamps.size}",
            )
        edges |= {int(i) + 1 for i in np.flatnonzero(labels[1:] != labels[:-1])}
    parts = []
    for first, last in _ranges(edges):
        inner = {first, last, *(first + place for place in _restarts(stamps[first:last]))}
        if split_gaps:
            for begin, end in _ranges(inner):
                inner |= {begin + place for place in _gaps(stamps[begin:end])}
        name = None if labels is None else _label(labels[first])
        cut = _ranges(inner)
        parts += [
            (slice(*each), name if name is None or len(cut) == 1 else f"{name}[{place}]")
            for place, each in enumerate(cut)
        ]
    return parts


def _label(value: object) -> str:
    """A label as people write it: 2 for 2.0."""
    whole = isinstance(value, float | np.floating) and float(value).is_integer()
    return f"{value:.0f}" if whole else str(value)


def _restarts(stamps: NDArray[np.float64]) -> list[int]:
    """Where time goes back to where it began, within a gap's length: another experiment."""
    back = np.flatnonzero(np.diff(stamps) < 0) + 1
    if not back.size:
        return []
    step = float(np.median(np.abs(np.diff(stamps))))
    return [int(place) for place in back if abs(stamps[place] - stamps[0]) <= GAP_FACTOR * step]


def _gaps(stamps: NDArray[np.float64]) -> list[int]:
    spacing = np.diff(stamps)
    if not (spacing.size and np.all(spacing > 0)):
        return []
    return [int(i) + 1 for i in np.flatnonzero(spacing > GAP_FACTOR * np.median(spacing))]


def _ranges(edges: Iterable[int]) -> list[tuple[int, int]]:
    return list(pairwise(sorted(edges)))


def require_sensible_base(
    stamps: NDArray[np.float64], resample_to_s: float, time_column: str
) -> None:
    """Refuse a base that makes ten samples and more of each row.

    Raises
    ------
    OptionError
        With the spacing and the rate that the stamps have.
    """
    spacing = float(np.median(np.diff(stamps))) if stamps.size > 1 else 0.0
    if spacing >= MOST_SAMPLES_PER_ROW * resample_to_s:
        count = round(float(np.ptp(stamps)) / resample_to_s) + 1
        raise OptionError(
            "the new base would make far more samples than the file has rows",
            found=f"{count} samples of {stamps.size} rows: rows are {spacing:.6g} s apart "
            f"({1 / spacing:.6g} Hz), the base is {resample_to_s:g} s",
            needed=f"fewer than {MOST_SAMPLES_PER_ROW} samples for each row",
            action=f"if the stamps are in ms or us, declare it with units, {time_column} = 'ms'; "
            "else take a longer resample_to_s",
        )
