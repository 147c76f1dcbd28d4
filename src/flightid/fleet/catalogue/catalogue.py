"""The catalogue as SQL sees it: parts and loose files as one, nothing written, nothing fetched."""

from __future__ import annotations

import datetime
import threading
from collections.abc import Sequence
from decimal import Decimal
from typing import Any, Self

import numpy as np

from flightid.errors import DataError, OptionError
from flightid.extras import extra_module
from flightid.fleet.catalogue.compaction import tables_of
from flightid.fleet.catalogue.loose import loose_logs, read_loose
from flightid.fleet.catalogue.parts import KEY_BYTES, KnownLogs, TablePart, read_keys, read_parts
from flightid.fleet.catalogue.schema import TABLES, FleetTable
from flightid.fleet.catalogue.store import ObjectStore, Store
from flightid.table import Cell, Column, Table

PURPOSE = "queries of a catalogue"
QUERY_S = 60.0
"""Longest time for one answer, s."""
ZONED = "TIMESTAMP WITH TIME ZONE"


class Catalogue:
    """An open catalogue. Made by `flightid.fleet.open`; close it, or use it in a ``with``.

    What is there when it is opened is what it shows: later logs need another.

    Parameters
    ----------
    store : Store
        Of one study and version.

    Example
    -------
    >>> import flightid as fid
    >>> with fid.fleet.open("fleet-catalogue") as catalogue:         # doctest: +SKIP
    ...     catalogue.query("select vehicle, avg(value) from parameters group by all").df()
    """

    def __init__(self, store: Store) -> None:
        duckdb = extra_module("duckdb", PURPOSE)
        self._store = store
        self._errors, self._interruption = duckdb.Error, duckdb.InterruptException
        self._connection = duckdb.connect(":memory:")
        parts, self.broken = read_parts(store)
        known = KnownLogs(store, parts)
        loose = [log for log in loose_logs(store) if not known.in_parts(log)]
        self._records = tables_of(list(read_loose(store, loose)))
        if isinstance(store, ObjectStore):
            self._connection.register_filesystem(store.fs)
        twice = _twice(store, parts)
        try:
            for table in TABLES.values():
                self._view(table, parts, twice)
        except duckdb.Error as error:
            raise DataError(
                "tables of the catalogue cannot be read",
                found=str(error)[:300],
                action="move parts/ away and run the fleet again: it takes those logs again",
            ) from error
        self._lock()

    def _view(
        self, table: FleetTable, parts: Sequence[TablePart], twice: dict[str, list[str]]
    ) -> None:
        """One table over everything that holds rows of it."""
        columns = ", ".join(f'"{name}"' for name in table.names)
        whole = [part for part in parts if part.rows.get(table.name) and part.name not in twice]
        selects = [f"SELECT {columns} FROM loose_{table.name}"]
        self._connection.register("arriving", self._records[table.name])
        self._connection.execute(f"CREATE TABLE loose_{table.name} AS SELECT * FROM arriving")
        self._connection.unregister("arriving")
        if whole:
            selects.append(f"SELECT {columns} FROM read_parquet([{self._files(table, whole)}])")
        for part in (part for part in parts if part.name in twice and part.rows.get(table.name)):
            logs = ", ".join(f"'{log}'" for log in twice[part.name])
            file = self._files(table, [part])
            select = f"SELECT {columns} FROM read_parquet([{file}]) WHERE log NOT IN ({logs})"
            selects.append(select)
        self._connection.execute(f"CREATE VIEW {table.name} AS {' UNION ALL '.join(selects)}")

    def _files(self, table: FleetTable, parts: Sequence[TablePart]) -> str:
        paths = (self._store.path(part.file(table.name)) for part in parts)
        return ", ".join("'" + path.replace("'", "''") + "'" for path in paths)

    def _lock(self) -> None:
        """From here on: no file but the catalogue's, no extension, no setting."""
        folder = self._store.root.replace("'", "''")
        for setting in (
            f"allowed_directories = ['{folder}/']",
            "temp_directory = ''",  # Nothing is written where somebody happens to work.
            "autoinstall_known_extensions = false",
            "autoload_known_extensions = false",
            "enable_external_access = false",
            "lock_configuration = true",
        ):
            self._connection.execute(f"SET {setting}")

    def query(self, sql: str) -> Any:  # noqa: ANN401 - of a library that an extra installs
        """Answer of one SELECT.

        Parameters
        ----------
        sql : str
            In DuckDB's dialect, over the tables of `tables`.

        Returns
        -------
        duckdb.DuckDBPyRelation
            ``.df()`` makes a pandas frame of it, ``.fetchall()`` tuples, ``.arrow()`` a table.

        Raises
        ------
        OptionError
            It is no SELECT, or DuckDB refuses it, with DuckDB's own words.
        """
        needed = "one SELECT over " + ", ".join(TABLES)
        try:
            statements = self._connection.extract_statements(sql)
            kinds = [statement.type.name for statement in statements]
            if kinds == ["SELECT"]:
                return self._connection.sql(sql)
        except self._errors as error:
            raise OptionError(
                "the catalogue cannot answer this", found=str(error).strip(), needed=needed
            ) from error
        found = ", ".join(kinds) or "no statement"
        raise OptionError("the catalogue takes questions alone", found=found, needed=needed)

    def answer(self, sql: str, *, time_s: float = QUERY_S) -> Table:
        """Answer of one SELECT as a table of plain values.

        Parameters
        ----------
        sql : str
            As `query` takes it.
        time_s : float
            Longest time for it, s.

        Raises
        ------
        OptionError
            As `query` raises it, or there was no answer in that time.
        """
        if not 0.0 < time_s <= threading.TIMEOUT_MAX:
            raise OptionError("no time for an answer", found=f"{time_s:g} s", needed="above 0 s")
        clock = threading.Timer(time_s, self._connection.interrupt)
        clock.daemon = True
        clock.start()
        try:
            found = _plain(self.query(sql))
            rows = tuple(tuple(map(_cell, row)) for row in found.fetchall())
        except self._interruption as error:
            raise OptionError(
                "the question takes too long",
                found=f"no answer after {time_s:g} s",
                action="ask for less, or give it more time (--time-s)",
            ) from error
        except self._errors as error:
            raise OptionError("the catalogue cannot answer this", found=str(error)) from error
        finally:
            clock.cancel()
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
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        """Place and number of logs."""
        return f"Catalogue({self._store.root!r}, {sum(self.counts().values())} logs)"


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


def _twice(store: Store, parts: Sequence[TablePart]) -> dict[str, list[str]]:
    """Logs of a part that an earlier one holds too, as two operators of a bucket may leave them."""
    if len(parts) < 2:
        return {}
    keys = [read_keys(store, part) for part in parts]
    origin = np.repeat(np.arange(len(parts)), [len(each) for each in keys])
    every = np.concatenate(keys)
    joined = every.view(f"S{KEY_BYTES}")
    order = np.lexsort((origin, joined))
    again = np.flatnonzero(joined[order][1:] == joined[order][:-1]) + 1
    found: dict[str, list[str]] = {}
    for at in order[again]:
        found.setdefault(parts[origin[at]].name, []).append(every[at].tobytes().hex())
    return found
