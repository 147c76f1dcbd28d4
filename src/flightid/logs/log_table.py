"""One message type of a log as columns, each read from the file when it is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from flightid.errors import MissingColumnError
from flightid.extras import extra_module
from flightid.logs.kept_arrays import KeptArrays
from flightid.logs.source import LogSource
from flightid.result import Result
from flightid.table import Column, Table

if TYPE_CHECKING:
    import pandas as pd


class LogTable(Result, schema="flightid.log_table/1"):
    """Rows of one message type (or one of its instances), by column.

    Columns are read on demand and kept; those read last also for other tables of their log.
    Numbers are scaled by the log's own multipliers and carry the unit that the log declares;
    nothing is converted to SI here.

    Parameters
    ----------
    source : LogSource
        Opened log.
    name : str
        A message that the log holds.
    instance : int, optional
        Instance; default: all rows.
    kept : KeptArrays, optional
        Columns that tables of this log have read.

    Raises
    ------
    MissingColumnError
        The instance does not exist.

    Example
    -------
    >>> import flightid as fid
    >>> log = fid.read_log("flight.bin")                             # doctest: +SKIP
    >>> log.table("RATE")["R"]                                       # doctest: +SKIP
    """

    def __init__(
        self,
        source: LogSource,
        name: str,
        instance: int | None = None,
        kept: KeptArrays | None = None,
    ) -> None:
        if instance is not None and instance not in source.messages[name].instances:
            instances = ", ".join(map(str, source.messages[name].instances))
            raise MissingColumnError(
                f"message {name} has no such instance",
                found=instance,
                needed="one of " + (instances or "none: it has no field"),
            )
        self._source = source
        self._name = name
        self._instance = instance
        # Not by way of MessageInfo: describing a message reads the stamps of all its rows.
        self._units, self._text_fields = source.fields(name)
        self._kept: dict[str, NDArray[np.float64]] = {}
        self._of_log = KeptArrays(0) if kept is None else kept
        self._time_s: NDArray[np.float64] | None = None

    @property
    def name(self) -> str:
        """Name of the message."""
        return self._name

    @property
    def instance(self) -> int | None:
        """Instance, or None for all rows."""
        return self._instance

    @property
    def columns(self) -> tuple[str, ...]:
        """Field names in the log's order, text included."""
        return tuple(self._units)

    def __len__(self) -> int:
        """Rows."""
        return self._source.rows(self.name, self._instance)

    def __iter__(self) -> Iterator[str]:
        """Field names."""
        return iter(self.columns)

    def __contains__(self, column: object) -> bool:
        """Tell whether there is such a field."""
        return column in self._units

    def unit(self, column: str) -> str:
        """Unit of the scaled numbers of a column.

        Raises
        ------
        MissingColumnError
            There is no such field.
        """
        self._require(column)
        return self._units[column]

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        """Scaled numbers, read-only, shape (n_rows,) or (n_rows, n_elements).

        Raises
        ------
        MissingColumnError
            There is no such field, or it holds text.
        """
        return self.arrays([column])[column]

    def arrays(self, columns: Iterable[str] | None = None) -> dict[str, NDArray[np.float64]]:
        """Several columns in one pass over the rows: faster than one after the other.

        Parameters
        ----------
        columns : iterable of str, optional
            Fields; default: all that hold numbers.

        Returns
        -------
        dict of str to ndarray
            Scaled numbers in the log's unit, read-only, shape (n_rows,) or (n_rows, n_elements).

        Raises
        ------
        MissingColumnError
            There is no such field, or it holds text.

        Example
        -------
        >>> import flightid as fid
        >>> log = fid.read_log("flight.bin")                         # doctest: +SKIP
        >>> log.table("RATE").arrays(["R", "ROut"])                  # doctest: +SKIP
        """
        if columns is None:
            columns = (name for name in self._units if name not in self._text_fields)
        names = tuple(columns)
        for name in names:
            self._require_numbers(name)
        for name in names:
            values = None if name in self._kept else self._of_log.get(self._key(name))
            if values is not None:
                self._kept[name] = values
        missing = [name for name in dict.fromkeys(names) if name not in self._kept]
        if missing:
            found = self._source.columns(self.name, missing, self._instance)
            for name, values in zip(missing, found, strict=True):
                self._kept[name] = self._of_log.put(self._key(name), values)
        return {name: self._kept[name] for name in names}

    def text(self, column: str) -> list[str]:
        """Texts of a column, one a row.

        Raises
        ------
        MissingColumnError
            There is no such field, or it holds numbers.
        """
        self._require(column)
        if column not in self._text_fields:
            raise MissingColumnError(
                f"field {self.name}.{column} holds numbers", needed="a field of text"
            )
        return self._source.texts(self.name, column, self._instance)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Stamps on the autopilot's clock, s, read-only, shape (n_rows,), in file order.

        Raises
        ------
        MissingColumnError
            The message has no stamp.
        """
        if self._time_s is None:
            self._time_s = self._of_log.get(self._key(None))
        if self._time_s is None:
            stamps = self._source.time_s(self.name, self._instance)
            self._time_s = self._of_log.put(self._key(None), stamps)
        return self._time_s

    def _key(self, column: str | None) -> tuple[str, int | None, str | None]:
        """By which a column, or with None the stamps, is kept for other tables."""
        return self._name, self._instance, column

    def to_pandas(self) -> pd.DataFrame:
        """All columns as a `pandas.DataFrame`; array fields become ``name[i]``.

        Raises
        ------
        OptionError
            pandas is not installed (extra ``tables``).
        """
        module = extra_module("pandas", "a pandas.DataFrame")
        frame: dict[str, object] = {}
        arrays = self.arrays()
        for column in self.columns:
            if column in self._text_fields:
                frame[column] = self.text(column)
            elif arrays[column].ndim == 1:
                frame[column] = arrays[column]
            else:
                for index, values in enumerate(arrays[column].T):
                    frame[f"{column}[{index}]"] = values
        return cast("pd.DataFrame", module.DataFrame(frame))

    def summary(self) -> Table:
        """Table of the fields with unit and range."""
        rows = tuple(self._summary_row(column) for column in self.columns)
        columns = (Column("field"), Column("unit"), Column("minimum"), Column("maximum"))
        return Table(repr(self), columns, rows)

    def _summary_row(self, column: str) -> tuple[str, str, float | None, float | None]:
        if column in self._text_fields or len(self) == 0:
            return column, self.unit(column), None, None
        finite = self[column][np.isfinite(self[column])]
        if finite.size == 0:
            return column, self.unit(column), None, None
        return column, self.unit(column), float(finite.min()), float(finite.max())

    def __repr__(self) -> str:
        """Rows, columns and rate on one line."""
        instance = "" if self._instance is None else f"[{self._instance}]"
        rate_hz = self._source.messages[self.name].rate_hz
        rate = "no rate" if rate_hz is None else f"{rate_hz:.4g} Hz"
        return f"LogTable({self.name}{instance}, {len(self)} rows x {len(self.columns)}, {rate})"

    def _require_numbers(self, column: str) -> None:
        self._require(column)
        if column in self._text_fields:
            raise MissingColumnError(
                f"field {self.name}.{column} holds text",
                needed="a field of numbers",
                action=f"read it with .text({column!r})",
            )

    def _require(self, column: str) -> None:
        if column not in self._units:
            raise MissingColumnError(
                f"message {self.name} has no such field",
                found=column,
                needed="one of " + ", ".join(self.columns),
            )
