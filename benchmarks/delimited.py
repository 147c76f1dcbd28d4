"""Delimited text to columns and to a record, against pandas and pyarrow: time and memory.

Each reader works in a process of its own, which says its processor seconds and its peak memory. It
has read a small table before: what a module loads when it first works is no time of reading.
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
FEW = 1000
"""Rows of the table that is read first."""
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
import {module} as module
for path in map(Path, sys.argv[1:]):
    begun = time.process_time()
    found = module.{call}
    taken = time.process_time() - begun
# A process is told the peak of the one that began it too; Linux knows its own as well.
status = Path("/proc/self/status")
peaks = status.read_text().split() if status.exists() else []
own = float(peaks[peaks.index("VmHWM:") + 1]) if "VmHWM:" in peaks else 0.0
most = own or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([taken, most / 1024]))
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


def _taken(name: str, *paths: Path) -> tuple[float, float]:
    """Processor seconds of the last table, and peak memory in MB."""
    module, call = READERS[name]
    text = ASKED.format(module=module, call=call)
    command = [sys.executable, "-c", text, *map(str, paths)]
    found = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    seconds, megabytes = json.loads(found)
    return float(seconds), float(megabytes)


def run() -> Table:
    """Processor seconds and peak memory of each reader that is installed, best of some turns."""
    names = [name for name, (module, _) in READERS.items() if _is_here(module)]
    with tempfile.TemporaryDirectory() as folder:
        small, path = (Path(folder) / name for name in ("small.csv", "table.csv"))
        write(small, FEW)
        write(path, ROWS)
        turns = [{name: _taken(name, small, path) for name in names} for _ in range(TURNS)]
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
