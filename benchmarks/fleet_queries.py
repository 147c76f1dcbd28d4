"""Questions to a catalogue of FLIGHTID_FLEET_ROWS rows a table (default 1,000,000), made up.

Each log gives one row of every table, written in parts of the catalogue's own form.
"""

from __future__ import annotations

import hashlib
import os
import resource
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from flightid.fleet.catalogue import compaction
from flightid.fleet.catalogue.catalogue import Catalogue
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
from flightid.fleet.catalogue.store import FolderStore
from flightid.table import Column, Table

PART = 100_000
QUESTIONS = {
    "count by outcome": "SELECT outcome, count(*) FROM logs GROUP BY ALL",
    "mean by vehicle": "SELECT vehicle, avg(value), stddev(value) FROM parameters GROUP BY ALL",
    "one vehicle over time": (
        "SELECT flown_at, value, stderr FROM parameters WHERE vehicle = 'V00042' ORDER BY 1"
    ),
    "join of two tables": (
        "SELECT p.vehicle, corr(p.value, c.value) FROM parameters p JOIN covariates c USING (log) "
        "GROUP BY ALL"
    ),
    "least margins": "SELECT vehicle, min(value) m FROM margins GROUP BY ALL ORDER BY m LIMIT 20",
    "reasons of refusal": (
        "SELECT reason, count(*) FROM logs WHERE outcome <> 'fitted' GROUP BY ALL"
    ),
}


def run() -> Table:
    """Seconds to open the catalogue and to answer."""
    count = int(os.environ.get("FLIGHTID_FLEET_ROWS", "1000000"))
    rows: list[tuple[str, float, float, int]] = []

    def took(question: str, begun: tuple[float, float], n: int) -> None:
        wall_s, used_s = (now - then for now, then in zip(_clocks(), begun, strict=True))
        rows.append((question, wall_s, used_s, n))
        print(f"{question}: {wall_s:.2f} s, {used_s:.2f} s of processor, {n} rows", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        store = FolderStore(folder)
        begun = _clocks()
        for first in range(0, count, PART):
            compaction._write(store, _tables(first, min(PART, count - first)), ())
        took("writing the parts", begun, count)
        begun = _clocks()
        with Catalogue(store) as catalogue:
            took("opening, first time", begun, count)
            for name, sql in QUESTIONS.items():
                begun = _clocks()
                took(name, begun, len(catalogue.query(sql).fetchall()))
        begun = _clocks()
        Catalogue(store).close()
        took("opening again", begun, count)
        size = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    columns = (
        Column("question"),
        Column("time", "s", 3),
        Column("processor", "s", 3),
        Column("rows"),
    )
    notes = (
        f"{count:,} rows in each of {len(TABLES)} tables, {size / 1e6:.0f} MB; "
        f"most memory {most:.0f} MiB.",
    )
    return Table("Questions to a catalogue", columns, tuple(rows), notes)


def _clocks() -> tuple[float, float]:
    return perf_counter(), process_time()


def _tables(first: int, count: int) -> dict[str, object]:
    rng = np.random.default_rng(first)
    logs = [hashlib.sha256(str(first + n).encode()).hexdigest() for n in range(count)]
    return {name: _table(table, logs, rng, first) for name, table in TABLES.items()}


def _table(table: FleetTable, logs: list[str], rng: np.random.Generator, first: int) -> object:
    import pyarrow  # noqa: PLC0415 - an extra's library

    columns = list(_columns(table, logs, rng, first))
    return pyarrow.Table.from_arrays(
        [pyarrow.array(values, kind.type) for values, kind in zip(
            columns, compaction.arrow_schema(table), strict=True)],
        schema=compaction.arrow_schema(table),
    )  # fmt: skip


def _columns(
    table: FleetTable, logs: list[str], rng: np.random.Generator, first: int
) -> Iterator[object]:
    n = len(logs)
    vehicles = [f"V{(first + i) // 50:05}" for i in range(n)]
    outcomes = rng.choice(["fitted", "refused", "failed"], n, p=[0.94, 0.05, 0.01]).tolist()
    fixed = {"log": logs, "vehicle": vehicles, "type": ["quad"] * n, "outcome": outcomes}
    for column in table.columns:
        if column.name in fixed:
            yield fixed[column.name]
        elif column.kind == INSTANT:
            yield np.datetime64("2026-01-01", "us") + rng.integers(0, 3 * 10**13, n)
        elif column.kind == NUMBER:
            yield rng.normal(size=n)
        elif column.kind == WHOLE:
            yield rng.integers(0, 9, n)
        elif column.kind == NUMBERS:
            yield list(rng.normal(size=(n, 10)))
        elif column.kind == TEXTS:
            yield [["Lp", "Ltphi", "T_m", "tau"]] * n
        else:
            assert column.kind == TEXT
            yield rng.choice(["first", "second", "third"], n).tolist()
