"""Compaction: loose files into Parquet parts, small parts into larger ones."""

from __future__ import annotations

import contextlib
import datetime
import hashlib
import io
from collections.abc import Iterator, Mapping, Sequence, Set
from importlib import import_module
from pathlib import Path
from typing import Any

from flightid.extras import extra_module
from flightid.fleet.catalogue.loose import BROKEN, QUARANTINE, loose_logs, loose_name, read_loose
from flightid.fleet.catalogue.parts import (
    KEYS,
    MANIFEST,
    PARTS,
    KnownLogs,
    TablePart,
    key_bytes,
    new_name,
    read_keys,
    read_parts,
)
from flightid.fleet.catalogue.record import LogRecord
from flightid.fleet.catalogue.schema import (
    INSTANT,
    NUMBER,
    NUMBERS,
    TABLES,
    TEXT,
    TEXTS,
    WHOLE,
    FleetTable,
)
from flightid.fleet.catalogue.store import FolderStore, Store

MOST_ROWS = 1_000_000
"""Of one table in one part."""
MOST_SMALL = 8
"""Parts below half of that which are left alone."""
PURPOSE = "compaction of a catalogue"


def compact(store: Store, *, at_least: int = 1) -> TablePart | None:
    """Move all loose files into one part.

    The manifest is written last and the loose files go after it: whoever dies in between leaves
    files that count once all the same.

    Parameters
    ----------
    store : Store
    at_least : int
        Loose files below which nothing is done.

    Returns
    -------
    TablePart or None
        None where there was nothing to do, or another operator is at it.
    """
    with _alone(store) as is_ours:
        logs = loose_logs(store)
        if not is_ours or len(logs) < at_least:
            return None
        known = KnownLogs(store, read_parts(store)[0])
        _remove(store, list(filter(known.in_parts, logs)))
        fresh = (log for log in logs if not known.in_parts(log))
        # A broken record stays loose: its log is to be run again.
        records = [each for each in read_loose(store, fresh) if each.reason != BROKEN]
        if not records:
            return None
        part = _write(store, tables_of(records), ())
        _remove(store, [record.log for record in records])
        return part


def _remove(store: Store, logs: Sequence[str]) -> None:
    for log in logs:
        store.remove(loose_name(log))


def merge(store: Store) -> list[TablePart]:
    """Join small parts where there are many, each new one at most `MOST_ROWS` long."""
    with _alone(store) as is_ours:
        parts, _ = read_parts(store)
        small = [part for part in parts if _longest(part) < MOST_ROWS // 2]
        if not is_ours or len(small) <= MOST_SMALL:
            return []
        return [rewrite(store, group) for group in _groups(small) if len(group) > 1]


def _groups(parts: Sequence[TablePart]) -> list[list[TablePart]]:
    groups: list[list[TablePart]] = []
    for part in parts:
        if groups and sum(map(_longest, groups[-1])) + _longest(part) <= MOST_ROWS:
            groups[-1].append(part)
        else:
            groups.append([part])
    return groups


def _longest(part: TablePart) -> int:
    return max(part.rows.values(), default=0)


def set_aside(store: Store) -> list[str]:
    """Move parts that cannot be used to quarantine, file by file; their names.

    Their logs are in no part from then on: the next run takes them again.
    """
    with _alone(store) as is_ours:
        parts, broken = read_parts(store) if is_ours else ([], [])
        replaced = {name for part in parts for name in part.replaces}
        moved = [name for name in broken if name not in replaced]
        for name in moved:
            for file in store.names(f"{PARTS}/{name}"):
                store.write(f"{QUARANTINE}/{name}.{file}", store.read(f"{PARTS}/{name}/{file}"))
        for name in broken:
            store.remove(f"{PARTS}/{name}")
        return moved


def rewrite(
    store: Store, parts: Sequence[TablePart], without: frozenset[str] = frozenset()
) -> TablePart:
    """One part in place of several, some logs left out; a log that two of them hold stands once."""
    arrow, compute = extra_module("pyarrow", PURPOSE), extra_module("pyarrow.compute", PURPOSE)
    parquet = extra_module("pyarrow.parquet", PURPOSE)
    tables: dict[str, list[Any]] = {name: [] for name in TABLES}
    seen = set(without)
    for part in parts:
        keys = {key.tobytes().hex() for key in read_keys(store, part)}
        gone = arrow.array(sorted(keys & seen), arrow.string())
        for name, table in TABLES.items():
            if not part.rows.get(name):
                continue
            rows = parquet.read_table(io.BytesIO(store.read(part.file(name))))
            rows = rows.select(list(table.names)).cast(arrow_schema(table))
            stays = compute.invert(compute.is_in(rows["log"], value_set=gone))
            tables[name].append(rows.filter(stays))
        seen |= keys
    joined = {
        name: arrow.concat_tables(found) if found else arrow_schema(TABLES[name]).empty_table()
        for name, found in tables.items()
    }
    made = _write(store, joined, tuple(part.name for part in parts))
    for part in parts:
        store.remove(f"{PARTS}/{part.name}")
    return made


def tables_of(records: Sequence[LogRecord]) -> dict[str, Any]:
    """Arrow tables of records, with the types of the schema."""
    return {
        name: _arrow_table(table, [row for each in records for row in each.rows.get(name, ())])
        for name, table in TABLES.items()
    }


def _arrow_table(table: FleetTable, rows: Sequence[Mapping[str, Any]]) -> Any:  # noqa: ANN401
    arrow = extra_module("pyarrow", PURPOSE)
    schema = arrow_schema(table)
    columns = []
    for column, kind in zip(table.columns, schema, strict=True):
        values = [row.get(column.name) for row in rows]
        if column.kind == INSTANT:
            columns.append(arrow.array(values, arrow.string()).cast(kind.type))
        else:
            columns.append(arrow.array(values, kind.type))
    return arrow.Table.from_arrays(columns, schema=schema)


def arrow_schema(table: FleetTable) -> Any:  # noqa: ANN401 - of a library that an extra installs
    """Schema of a table in Arrow's types."""
    arrow = extra_module("pyarrow", PURPOSE)
    kinds = {
        TEXT: arrow.string(),
        NUMBER: arrow.float64(),
        WHOLE: arrow.int64(),
        INSTANT: arrow.timestamp("us"),
        TEXTS: arrow.list_(arrow.string()),
        NUMBERS: arrow.list_(arrow.float64()),
    }
    return arrow.schema([(column.name, kinds[column.kind]) for column in table.columns])


def _write(store: Store, tables: Mapping[str, Any], replaces: tuple[str, ...]) -> TablePart:
    parquet = extra_module("pyarrow.parquet", PURPOSE)
    logs = tables["logs"]["log"].to_pylist()
    name, files = new_name(logs), dict[str, bytes]()
    for table, rows in tables.items():
        if not rows.num_rows:
            continue
        ordered = rows.sort_by([("vehicle", "ascending"), ("flown_at", "ascending")])
        target = io.BytesIO()
        parquet.write_table(ordered, target, compression="zstd")
        files[f"{table}.parquet"] = target.getvalue()
    files[KEYS] = key_bytes(logs)
    for file, content in files.items():
        store.write(f"{PARTS}/{name}/{file}", content)
    outcomes: dict[str, int] = {}
    for outcome in tables["logs"]["outcome"].to_pylist():
        outcomes[outcome] = outcomes.get(outcome, 0) + 1
    counts = {table: rows.num_rows for table, rows in tables.items()}
    sizes = {file: len(content) for file, content in files.items()}
    digests = {file: hashlib.sha256(content).hexdigest() for file, content in files.items()}
    part = TablePart(name, counts, sizes, digests, outcomes, replaces)
    store.write(f"{PARTS}/{name}/{MANIFEST}", part.to_bytes())
    return part


@contextlib.contextmanager
def _alone(store: Store) -> Iterator[bool]:
    """Whether nobody else compacts the same folder; in a bucket two may, and readers sort it out.

    The lock goes with its process, however that ends.
    """
    if not isinstance(store, FolderStore):
        yield True
        return
    try:
        locks = import_module("fcntl")
    except ModuleNotFoundError:
        yield True
        return
    Path(store.root).mkdir(parents=True, exist_ok=True)
    with Path(store.root, ".compaction").open("a") as file:
        try:
            locks.flock(file, locks.LOCK_EX | locks.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        yield True


def read_columns(
    store: Store, parts: Sequence[TablePart], table: str, names: Sequence[str]
) -> Iterator[tuple[str, ...]]:
    """Some columns of a table as text, row by row; empty text for null."""
    parquet = extra_module("pyarrow.parquet", PURPOSE)
    for part in (part for part in parts if part.rows.get(table)):
        content = io.BytesIO(store.read(part.file(table)))
        rows = parquet.read_table(content, columns=list(names))
        columns = [rows[name].to_pylist() for name in names]
        for row in zip(*columns, strict=True):
            yield tuple(map(text_of, row))


def read_records(store: Store, parts: Sequence[TablePart], logs: Set[str]) -> Iterator[LogRecord]:
    """Records of some logs as parts hold them, of each the first."""
    parquet = extra_module("pyarrow.parquet", PURPOSE)
    left = set(logs)
    for part in parts:
        mine = {key.tobytes().hex() for key in read_keys(store, part)} & left
        found = {log: {name: list[dict[str, Any]]() for name in TABLES} for log in mine}
        for name, table in TABLES.items() if mine else ():
            if not part.rows.get(name):
                continue
            content = io.BytesIO(store.read(part.file(name)))
            only = [("log", "in", sorted(mine))]
            rows = parquet.read_table(content, columns=list(table.names), filters=only)
            for row in rows.to_pylist():
                found[row["log"]][name].append({key: _written(row[key]) for key in row})
        yield from (LogRecord(log, found[log]) for log in sorted(mine))
        left -= mine


def _written(value: Any) -> Any:  # noqa: ANN401 - of a table
    """A value of a part as records have it: instants as text."""
    return value.isoformat() if isinstance(value, datetime.datetime) else value


def text_of(value: object) -> str:
    """A value as text; empty for null."""
    return "" if value is None else str(value)
