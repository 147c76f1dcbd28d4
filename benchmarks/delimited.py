"""Delimited text to columns and to a record, against pandas and pyarrow: time and memory.

Each reader works in a process of its own, which says its processor seconds and its peak memory.
`FLIGHTID_CSV_ROWS=10000000` makes the table of ten million rows (680 MB of text).

Run: python -m benchmarks delimited
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from flightid.table import Cell, Column, Table

ROWS = int(os.environ.get("FLIGHTID_CSV_ROWS", "1000000"))
AT_ONCE = 100_000
TURNS = 3
RECORD = "a record, checks and digest included"
READERS = {
    "columns": ("flightid.record.formats.csv", "read_columns(path)"),
    RECORD: ("flightid", "read_records(path, inputs=['u'], outputs=['y', 'z'])"),
    "pandas": ("pandas", "read_csv(path)"),
    "pyarrow": ("pyarrow.csv", "read_csv(path)"),
}
"""Module and call of each."""
ASKED = """
import json, resource, time, sys
from pathlib import Path
path = Path(sys.argv[1])
import {module} as module
begun = time.process_time()
found = module.{call}
taken = time.process_time() - begun
print(json.dumps([taken, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""


def write(path: Path, n_rows: int) -> None:
    """A time and three channels of 15 to 18 digits, as programs print doubles."""
    random = np.random.default_rng(0)
    with path.open("w") as stream:
        stream.write("time [s],u,y,z\n")
        for first in range(0, n_rows, AT_ONCE):
            count = min(AT_ONCE, n_rows - first)
            stamps = np.arange(first, first + count) / 100.0
            rows = zip(stamps.tolist(), *random.standard_normal((3, count)).tolist(), strict=True)
            stream.writelines(f"{t!r},{u!r},{y!r},{z!r}\n" for t, u, y, z in rows)


def _taken(name: str, path: Path) -> tuple[float, float]:
    module, call = READERS[name]
    text = ASKED.format(module=module, call=call)
    command = [sys.executable, "-c", text, str(path)]
    found = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    seconds, megabytes = json.loads(found)
    return float(seconds), float(megabytes)


def run() -> Table:
    """Processor seconds and peak memory of each reader that is installed, best of some turns."""
    names = [name for name, (module, _) in READERS.items() if _is_here(module)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        write(path, ROWS)
        turns = [{name: _taken(name, path) for name in names} for _ in range(TURNS)]
    rows: list[tuple[Cell, ...]] = []
    for name in names:
        found = [turn[name] for turn in turns]
        best = min(seconds for seconds, _ in found)
        rows.append((name, best, max(megabytes for _, megabytes in found)))
    columns = (
        Column("reader"),
        Column("processor time", "s", 3),
        Column("peak memory", "MB", 4),
    )
    return Table(f"Delimited text, {ROWS} rows of four columns", columns, tuple(rows))


def _is_here(module: str) -> bool:
    return importlib.util.find_spec(module.partition(".")[0]) is not None
