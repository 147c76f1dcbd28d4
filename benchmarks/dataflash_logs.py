"""DataFlash logs: columns of seven message types, against pymavlink, every value compared."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pymavlink import DFReader

import flightid as fid
from flightid.logs import DataflashWriter
from flightid.table import Cell, Column, Table

MESSAGES = ("IMU", "PIDR", "PIDP", "PIDY", "RCOU", "VIBE", "XKF1")
COPIES = 16
Columns = dict[tuple[str, str], NDArray[np.float64]]
SAME = 1e-15
"""Relative: pymavlink divides where flightid multiplies by the inverse."""
REPEATS = 15
THEIR_REPEATS = 2


def run() -> Table:
    """Megabytes for each second of processor time (one core), from a closed file to columns."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [row for path in _logs(Path(folder)) for row in _rows(path)]
    columns = (
        Column("log"),
        Column("size", "MB"),
        Column("values compared"),
        Column("different"),
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


def _rows(path: Path) -> list[tuple[Cell, ...]]:
    size = path.stat().st_size / 1e6
    ours = size / _best(lambda: _ours(path), REPEATS)
    theirs = size / _best(lambda: _theirs(path), THEIR_REPEATS)
    # At each joint of the copies pymavlink makes a row of a torn record and the next copy's bytes.
    compared: tuple[int | None, int | None] = (None, None)
    if f"_x{COPIES}" not in path.stem:
        compared = differences(_ours(path), _theirs(path))
    return [(path.name, size, *compared, ours, theirs, ours / theirs)]


def _best(work: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def differences(ours: Columns, theirs: Columns) -> tuple[int, int]:
    """Values of both, and how many are not the same; both must have the same columns."""
    if ours.keys() != theirs.keys():
        raise AssertionError(f"columns of one reader alone: {sorted(ours.keys() ^ theirs.keys())}")
    different = 0
    for name, values in ours.items():
        other = theirs[name]
        same = values.size == other.size and np.sum(np.isclose(values, other, rtol=SAME, atol=0.0))
        different += max(values.size, other.size) - int(same)
    return sum(values.size for values in ours.values()), different


def _ours(path: Path) -> Columns:
    log = fid.read_log(path)
    return {
        (name, column): values
        for name in MESSAGES
        for column, values in log.table(name).arrays().items()
    }


def _theirs(path: Path) -> Columns:
    reader = DFReader.DFReader_binary(str(path))
    rows: dict[str, list[list[float]]] = {name: [] for name in MESSAGES}
    fields: dict[str, list[str]] = {}
    while (message := reader.recv_match(type=list(MESSAGES))) is not None:
        name = message.get_type()
        fields[name] = message.get_fieldnames()
        rows[name].append([getattr(message, field) for field in fields[name]])
    reader.close()
    return {
        (name, field): column * 1e-6 if field == "TimeUS" else column  # flightid: seconds
        for name, values in rows.items()
        for field, column in zip(fields[name], np.array(values, np.float64).T, strict=True)
    }
