"""PX4 ULog against pyulog: the same file, to the same columns, in the same run.

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
from pyulog import ULog
from tests.ulog_builder import UlogBuilder

from flightid import _native
from flightid.table import Column, Table

REPEATS = 9
TOPICS = {"rates": 400, "torque": 400, "attitude": 250, "motors": 250, "battery": 10}


def run() -> Table:
    """Megabytes per second to columns, and the ratio to pyulog."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.environ.get("FLIGHTID_ULOG") or _written(Path(folder))
        size = Path(path).stat().st_size / 1e6
        first = [name for name, _, rows in _native.Ulog(Path(path).read_bytes()).tables() if rows]
        jobs: tuple[tuple[str, Callable[[], object], Callable[[], object]], ...] = (
            ("every column", lambda: _ours(path, None), lambda: _theirs(path, None)),
            ("three topics", lambda: _ours(path, first[:3]), lambda: _theirs(path, first[:3])),
        )
        rows = []
        for job, ours, theirs in jobs:
            fast, slow = _median_s(ours), _median_s(theirs)
            rows.append((job, size, size / fast, size / slow, slow / fast))
    columns = (
        Column("job"),
        Column("size", "MB", 3),
        Column("flightid", "MB/s", 3),
        Column("pyulog", "MB/s", 3),
        Column("ratio", "", 3),
    )
    return Table("PX4 ULog to columns, median of 9", columns, tuple(rows))


def _ours(path: str | Path, topics: list[str] | None) -> int:
    log = _native.Ulog(Path(path).read_bytes())
    read = 0
    for name, instance, count in log.tables():
        if count and (topics is None or name in topics):
            columns = [column for column, _ in log.columns(name)]
            read += sum(values.size for values in log.gather(name, instance, columns))
    return read


def _theirs(path: str | Path, topics: list[str] | None) -> int:
    # pyulog's columns are views of interleaved rows: make them columns, as ours are.
    tables = ULog(str(path), topics).data_list
    return sum(
        np.asarray(values, dtype=np.float64).size
        for table in tables
        for values in table.data.values()
    )


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
