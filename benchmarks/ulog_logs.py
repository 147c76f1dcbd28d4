"""PX4 ULog against pyulog: the same file, to the same columns, every value compared, in one run.

Reads the log that FLIGHTID_ULOG names; without it, one of 60 s that the benchmark writes itself.
"""

from __future__ import annotations

import os
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from pyulog import ULog
from tests.ulog_builder import UlogBuilder

from flightid import _native
from flightid.table import Column, Table

Columns = dict[tuple[str, int, str], NDArray[np.float64]]
EMPTY = np.zeros(0)
REPEATS = 9
TOPICS = {"rates": 400, "torque": 400, "attitude": 250, "motors": 250, "battery": 10}


def run() -> Table:
    """Megabytes per second to columns, and the ratio to pyulog."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.environ.get("FLIGHTID_ULOG") or _written(Path(folder))
        size = Path(path).stat().st_size / 1e6
        first = [name for name, _, rows in _native.Ulog(Path(path).read_bytes()).tables() if rows]
        jobs: tuple[tuple[str, Callable[[], Columns], Callable[[], Columns]], ...] = (
            ("every column", lambda: _ours(path, None), lambda: _theirs(path, None)),
            ("three topics", lambda: _ours(path, first[:3]), lambda: _theirs(path, first[:3])),
        )
        rows = []
        for job, ours, theirs in jobs:
            fast, slow = _median_s(ours), _median_s(theirs)
            compared, different = differences(ours(), theirs())
            rows.append((job, size, compared, different, size / fast, size / slow, slow / fast))
    columns = (
        Column("job"),
        Column("size", "MB", 3),
        Column("values compared"),
        Column("different"),
        Column("flightid", "MB/s", 3),
        Column("pyulog", "MB/s", 3),
        Column("ratio", "", 3),
    )
    return Table("PX4 ULog to columns, median of 9", columns, tuple(rows))


def differences(ours: Columns, theirs: Columns) -> tuple[int, int]:
    """Values, and how many are not the same; a column or row that one lacks counts whole."""
    lacking = set(ours) ^ set(theirs)
    different = sum((ours.get(name, theirs.get(name, EMPTY))).size for name in lacking)
    for name in set(ours) & set(theirs):
        a, b = ours[name], theirs[name]
        same = a.size == b.size and np.sum((a == b) | (np.isnan(a) & np.isnan(b)))
        different += max(a.size, b.size) - int(same)
    return sum(values.size for values in ours.values()), different


def _ours(path: str | Path, topics: list[str] | None) -> Columns:
    log = _native.Ulog(Path(path).read_bytes())
    read: Columns = {}
    for name, instance, count in log.tables():
        if count and (topics is None or name in topics):
            columns = [column for column, _ in log.columns(name)]
            gathered = log.gather(name, instance, columns)
            read |= {
                (name, instance, column): values
                for column, values in zip(columns, gathered, strict=True)
            }
    return read


def _theirs(path: str | Path, topics: list[str] | None) -> Columns:
    # pyulog's columns are views of interleaved rows: make them columns, as ours are.
    return {
        (table.name, table.multi_id, column): np.asarray(values, dtype=np.float64)
        for table in ULog(str(path), topics).data_list
        for column, values in table.data.items()
        if "_padding" not in column
    }


def _median_s(job: Callable[[], object]) -> float:
    times = []
    for _ in range(REPEATS):
        start = perf_counter()
        job()
        times.append(perf_counter() - start)
    return float(np.median(times))


def _written(folder: Path) -> Path:
    built = UlogBuilder()
    for topic in TOPICS:
        built.format(f"{topic}:uint64_t timestamp;uint64_t timestamp_sample;float[10] value;")
    for number, topic in enumerate(TOPICS):
        built.announce(topic, number)
    values = struct.pack("<10f", *range(10))
    for tick in range(60 * 2000):
        for number, rate in enumerate(TOPICS.values()):
            if tick % (2000 // rate) == 0:
                built.sample(number, "QQ40s", 500 * tick, 500 * tick, values)
    path = folder / "written.ulg"
    path.write_bytes(bytes(built))
    return path


if __name__ == "__main__":
    print(run())
