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
from flightid.units import canonical

MOST_SAMPLES_PER_ROW = 10
"""A new base that makes as many samples of a row invents them: the unit of the time is wrong."""


def column_unit(
    table: ColumnTable, column: str, name: str, units: Mapping[str, str], default: str
) -> str:
    """Unit of a column: what is declared, else what the file says, else the end of its name.

    Raises
    ------
    UnitError
        A unit that is not known.
    """
    stated, declared = table.unit(column), units.get(name)
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
