"""Rows that channels take of a table: by their stamps, in manoeuvres, with what is said of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.files import sha256_of_file
from flightid.frozen import dataclass
from flightid.record.channel import Channel
from flightid.record.formats import ColumnTable
from flightid.record.record import Record
from flightid.record.row_grids import Array, ChannelColumn, Rows
from flightid.record.rows import manoeuvres
from flightid.record.sample_faults import SampleFault
from flightid.record.witnesses import turning_columns
from flightid.table import Cell


@dataclass(frozen=True, eq=False)
class SourceRows:
    """Channels of a table.

    Attributes
    ----------
    table : ColumnTable
    shared : ndarray, shape (n,)
        Stamps of all columns, s; empty where they have stamps of their own.
    wanted : tuple of ChannelColumn
    """

    table: ColumnTable
    shared: NDArray[np.float64]
    wanted: tuple[ChannelColumn, ...]

    def rows(self) -> Rows:
        """Stamps and samples by channel.

        Raises
        ------
        DataError
            A column is not as long as its stamps, or holds no numbers.
        """
        rows = {}
        for item in self.wanted:
            clock = self.table.clock
            time_s = self.shared if clock is None else clock(item.column).time_s
            values = self.table.column(item.column)
            if values.size != time_s.size:
                raise DataError(
                    f"column {item.column!r} is not as long as the time",
                    found=f"{values.size} samples",
                    needed=f"{time_s.size}",
                )
            rows[item.channel.name] = time_s, values
        return rows

    def parts(
        self, record_column: str | None, *, split_gaps: bool
    ) -> Iterator[tuple[slice, str | None, list[tuple[Channel, Array, Array]]]]:
        """Rows of each manoeuvre, its name, and the columns that bear witness to its units."""
        if self.table.clock is not None:
            yield slice(None), None, []
            return
        shared = self.shared
        taken = {item.column: item.channel for item in self.wanted}
        witnesses = turning_columns(self.table, taken, shared.size)
        for part, label in manoeuvres(self.table, record_column, shared, split_gaps=split_gaps):
            yield part, label, [(each, shared[part], values[part]) for each, values in witnesses]

    def said(
        self,
        files: Iterable[str | Path | Record],
        column_names: Sequence[str],
        derive: Mapping[str, str],
    ) -> dict[str, Cell]:
        """What the history tells: own stamps, an encoding, files joined, names, formulas."""
        found: dict[str, Cell] = {}
        if self.table.clock is not None:
            stamps = dict.fromkeys(self.table.clock(item.column).said for item in self.wanted)
            found["stamps"] = "; ".join(stamps)
        paths = [Path(file) for file in files if not isinstance(file, Record)]
        found |= {f"joined {path.name}": sha256_of_file(path) for path in paths}
        if self.table.encoding:
            found["encoding"] = self.table.encoding
        if column_names:
            found["column_names"] = ",".join(column_names)
        return found | {f"derived {name}": formula for name, formula in derive.items()}

    def doubts(self, rows: Rows) -> Iterator[SampleFault]:
        """What is to be doubted of the clocks of channels."""
        for item in self.wanted:
            finding = None if self.table.clock is None else self.table.clock(item.column).finding
            if finding is not None:
                time_s = rows[item.channel.name][0]
                first, last = float(time_s[0]), float(time_s[-1])
                yield SampleFault(item.channel.name, first, last, finding)


def moves(table: ColumnTable, key: str) -> bool:
    """Whether a column is of numbers that are all there and do not stand still."""
    values = table.raw(key)
    return bool(
        values.dtype.kind in "fiub"
        and values.size > 1
        and np.all(np.isfinite(values))
        and np.ptp(values) > 0.0
    )
