"""DataFlash logs: columns of seven message types, against pymavlink on the same file."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pymavlink import DFReader

import flightid as fid
from flightid.logs import DataflashWriter
from flightid.table import Column, Table

MESSAGES = ("IMU", "PIDR", "PIDP", "PIDY", "RCOU", "VIBE", "XKF1")
COPIES = 16
REPEATS = 15
THEIR_REPEATS = 2


def run() -> Table:
    """Megabytes for each second of processor time (one core), from a closed file to columns."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [row for path in _logs(Path(folder)) for row in _rows(path)]
    columns = (
        Column("log"),
        Column("size", "MB"),
        Column("flightid", "MB/s"),
        Column("pymavlink", "MB/s"),
        Column("ratio"),
    )
    return Table("DataFlash to columns of seven message types", columns, tuple(rows))


def _logs(folder: Path) -> list[Path]:
    shared = Path(os.environ.get("FLIGHTID_DATA", "../shared/data")) / "logs"
    real = shared / "arducopter_457.BIN"
    path = real if real.is_file() else _written(folder / "written.bin")
    large = folder / f"{path.stem}_x{COPIES}.bin"
    large.write_bytes(path.read_bytes() * COPIES)
    return [path, large]


def _written(path: Path) -> Path:
    writer = DataflashWriter()
    time_us = np.arange(5000) * 10_000
    for name in MESSAGES:
        writer.add(name, time_us, {})
    return writer.write(path)


def _rows(path: Path) -> list[tuple[str, float, float, float, float]]:
    size = path.stat().st_size / 1e6
    ours = size / _best(lambda: _ours(path), REPEATS)
    theirs = size / _best(lambda: _theirs(path), THEIR_REPEATS)
    return [(path.name, size, ours, theirs, ours / theirs)]


def _best(work: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def _ours(path: Path) -> list[np.ndarray]:
    log = fid.read_log(path)
    return [values for name in MESSAGES for values in log.table(name).arrays().values()]


def _theirs(path: Path) -> list[np.ndarray]:
    reader = DFReader.DFReader_binary(str(path))
    rows: dict[str, list[list[float]]] = {name: [] for name in MESSAGES}
    while (message := reader.recv_match(type=list(MESSAGES))) is not None:
        name = message.get_type()
        rows[name].append([getattr(message, field) for field in message.get_fieldnames()])
    reader.close()
    return [np.array(values, np.float64) for values in rows.values()]
