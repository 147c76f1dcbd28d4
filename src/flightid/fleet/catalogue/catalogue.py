"""The catalogue as SQL sees it: parts and loose files as one, nothing written, nothing fetched."""

from __future__ import annotations

import datetime
import re
import threading
from collections.abc import Sequence
from decimal import Decimal
from typing import Any, Self

from flightid.errors import DataError, OptionError
from flightid.extras import extra_module
from flightid.fleet.catalogue.compaction import tables_of
from flightid.fleet.catalogue.newest import LOOSE, VersionRecords, older_records
from flightid.fleet.catalogue.on_time import TimedConnection
from flightid.fleet.catalogue.parts import TablePart
from flightid.fleet.catalogue.schema import TABLES, FleetTable
from flightid.fleet.catalogue.store import ObjectStore, Store
from flightid.reading import memory_budget
from flightid.table import Cell, Column, Table

PURPOSE = "queries of a catalogue"
QUERY_S = 60.0
"""Longest time for one answer, s."""
MOST_ANSWERED, MOST_SHOWN = 50_000_000, 100_000
"""Rows of an answer that is computed with, and of one that is shown."""
MORE_TIME = "ask for less, or give it more time (--time-s)"
HELD = "ask for no huge value; open the catalogue anew, for this one is held until it is made"
ZONED = "TIMESTAMP WITH TIME ZONE"
MEMORY_WORDS = re.compile("(?i)out of memory|failed to allocate|could not allocate")


class Catalogue:
    """An open catalogue. Made by `flightid.fleet.open`; close it, or use it in a ``with``.

    What is there when it is opened is what it shows: later logs need another.

    Parameters
    ----------
    store : Store
        Of one study and version.
    earlier : sequence of Store
        Of earlier ones, whose records count for logs that have no newer one.

    Example
    -------
    >>> import flightid as fid
    >>> with fid.fleet.open("fleet.toml") as catalogue:
    ...     catalogue.query("select outcome, count(*) from logs group by all order by 1").fetchall()
    [('fitted', 40), ('refused', 3)]
    """

    def __init__(self, store: Store, earlier: Sequence[Store] = ()) -> None:
        duckdb = extra_module("duckdb", PURPOSE)
        self._store = store
        self._errors = duckdb.Error
        self._connection = duckdb.connect(":memory:")
        self._timed = TimedConnection(self._connection)
        sets = [VersionRecords.of(each) for each in (store, *earlier)]
        self.broken = sets[0].broken
        older = older_records(sets)
        hidden = {(place, log) for (place, name), logs in older.items() if name == LOOSE
                  for log in logs}  # fmt: skip
        records = [
            record
            for place, each in enumerate(sets)
            for record in each.records
            if (place, record.log) not in hidden
        ]
        self._records = tables_of(records)
        if isinstance(store, ObjectStore):
            self._connection.register_filesystem(store.fs)
        try:
            for table in TABLES.values():
                self._view(table, sets, older)
        except duckdb.Error as error:
            raise DataError(
                "tables of the catalogue cannot be read",
                found=str(error)[:300],
                action="move parts/ away and run the fleet again: it takes those logs again",
            ) from error
        self._lock([each.store.root for each in sets])

    def _view(
        self,
        table: FleetTable,
        sets: Sequence[VersionRecords],
        older: dict[tuple[int, str], list[str]],
    ) -> None:
        """One table over everything that holds rows of it, each log by its newest record."""
        columns = ", ".join(f'"{name}"' for name in table.names)
        selects = [f"SELECT {columns} FROM loose_{table.name}"]
        self._connection.register("arriving", self._records[table.name])
        self._connection.execute(f"CREATE TABLE loose_{table.name} AS SELECT * FROM arriving")
        self._connection.unregister("arriving")
        for place, each in enumerate(sets):
            mine = [part for part in each.parts if part.rows.get(table.name)]
            whole = [part for part in mine if (place, part.name) not in older]
            if whole:
                files = _files(each.store, table, whole)
                selects.append(f"SELECT {columns} FROM read_parquet([{files}])")
            for part in mine:
                if logs := older.get((place, part.name)):
                    left = ", ".join(f"'{log}'" for log in logs)
                    file = _files(each.store, table, [part])
                    selects.append(
                        f"SELECT {columns} FROM read_parquet([{file}]) WHERE log NOT IN ({left})"
                    )
        self._connection.execute(f"CREATE VIEW {table.name} AS {' UNION ALL '.join(selects)}")

    def _lock(self, places: Sequence[str]) -> None:
        """From here on: no file but the catalogue's, no extension, no setting."""
        folders = ", ".join("'" + place.replace("'", "''") + "/'" for place in places)
        for setting in (
            f"allowed_directories = [{folders}]",
            f"memory_limit = '{memory_budget() >> 20}MiB'",
            "temp_directory = ''",  # Nothing is written where somebody happens to work.
            "autoinstall_known_extensions = false",
            "autoload_known_extensions = false",
            "enable_external_access = false",
            "lock_configuration = true",
        ):
            self._connection.execute(f"SET {setting}")

    def query(self, sql: str, *, time_s: float = QUERY_S, most_rows: int = MOST_ANSWERED) -> Any:  # noqa: ANN401 - of a library that an extra installs
        """Answer of one SELECT, worked out before this returns.

        Parameters
        ----------
        sql : str
            In DuckDB's dialect, over the tables of `tables`.
        time_s : float
            Longest time for it, s. A step of DuckDB that makes one huge value cannot be ended: it
            is left to itself, and the catalogue takes no other question until it is over; its
            memory is not bounded here (``flightid fleet query`` bounds that too).
        most_rows : int
            Longest answer.

        Returns
        -------
        duckdb.DuckDBPyRelation
            Over the answer: ``.df()`` makes a pandas frame of it, ``.fetchall()`` tuples,
            ``.arrow()`` a table.

        Raises
        ------
        OptionError
            It is no SELECT, or DuckDB refuses it, with DuckDB's own words; or its answer takes
            longer, or is longer, than it may.
        """
        if not 0.0 < time_s <= threading.TIMEOUT_MAX:
            raise OptionError("no time for an answer", found=f"{time_s:g} s", needed="above 0 s")
        try:
            found = self._timed.work_out(
                lambda: self._asked(sql).limit(most_rows + 1).to_arrow_table(), time_s
            )
        except TimeoutError as error:
            raise OptionError(
                "the question takes too long",
                found=str(error),
                action=HELD if self._timed.is_held else MORE_TIME,
            ) from error
        except self._errors as error:
            raise _unanswered(error) from error
        if found.num_rows > most_rows:
            raise OptionError(
                "the answer is too long",
                found=f"more than {most_rows:,} rows",
                action="group or limit it, or allow more (--most-rows)",
            )
        return self._connection.from_arrow(found)

    def _asked(self, sql: str) -> Any:  # noqa: ANN401 - of a library that an extra installs
        """What DuckDB makes of one SELECT, not worked out."""
        needed = "one SELECT over " + ", ".join(TABLES)
        try:
            statements = self._connection.extract_statements(sql)
            kinds = [statement.type.name for statement in statements]
            if kinds == ["SELECT"]:
                return self._connection.sql(sql)
        except self._errors as error:
            raise _unanswered(error, needed) from error
        found = ", ".join(kinds) or "no statement"
        raise OptionError("the catalogue takes questions alone", found=found, needed=needed)

    def answer(self, sql: str, *, time_s: float = QUERY_S, most_rows: int = MOST_SHOWN) -> Table:
        """Answer of one SELECT as a table of plain values.

        Parameters
        ----------
        sql : str
            As `query` takes it.
        time_s : float
            Longest time for it, s.
        most_rows : int
            Longest answer.

        Raises
        ------
        OptionError
            As `query` raises it.
        """
        found = _plain(self.query(sql, time_s=time_s, most_rows=most_rows))
        rows = tuple(tuple(map(_cell, row)) for row in found.fetchall())
        return Table("Answer", tuple(map(Column, found.columns)), rows)

    def table(self, name: str) -> Any:  # noqa: ANN401 - of a library that an extra installs
        """A whole table as a relation.

        Raises
        ------
        OptionError
            There is no such table.
        """
        if name not in TABLES:
            raise OptionError("there is no such table", found=name, needed=", ".join(TABLES))
        return self.query(f"SELECT * FROM {name}")

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables."""
        return tuple(TABLES)

    def counts(self) -> dict[str, int]:
        """Logs by outcome."""
        rows = self.query("SELECT outcome, count(*) FROM logs GROUP BY ALL ORDER BY 1").fetchall()
        return {str(name): int(n) for name, n in rows}

    def close(self) -> None:
        """Let go of it."""
        self._timed.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        """Place and number of logs."""
        return f"Catalogue({self._store.root!r}, {sum(self.counts().values())} logs)"


def _unanswered(error: Exception, needed: str | None = None) -> OptionError:
    """DuckDB's words; where memory is short without its advice to SET what is locked here."""
    said = str(error).strip()
    is_full = MEMORY_WORDS.search(said) is not None
    said = said.partition("\n")[0] if is_full else said
    action = "ask for less, or give it more memory (--memory)" if is_full else None
    return OptionError("the catalogue cannot answer this", found=said, needed=needed, action=action)


def _plain(found: Any) -> Any:  # noqa: ANN401 - of a library that an extra installs
    """Instants with a zone as text: values of Python need one more library for them."""
    if ZONED not in map(str, found.types):
        return found
    names = ('"' + name.replace('"', '""') + '"' for name in found.columns)
    return found.project(
        ", ".join(
            f"CAST({name} AS VARCHAR) AS {name}" if str(kind) == ZONED else name
            for name, kind in zip(names, found.types, strict=True)
        )
    )


def _cell(value: object) -> Cell:
    """A value as tables hold it."""
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, datetime.datetime):
        return value.isoformat(" ")
    if isinstance(value, Decimal):
        return float(value)
    return str(value)


def _files(store: Store, table: FleetTable, parts: Sequence[TablePart]) -> str:
    """Paths of a table's files as SQL lists them."""
    paths = (store.path(part.file(table.name)) for part in parts)
    return ", ".join("'" + path.replace("'", "''") + "'" for path in paths)
