"""Betaflight blackbox to columns, against orangebox: same file, every value compared, one run.

orangebox is no part of `.[bench]`: its wheel declares its scripts wrongly, so that pip unpacks it
and then ends with an error. `pip install --no-deps orangebox` leaves a package that works, which
is all that is needed here; it is GPL, and nothing of it is in flightid.

The file is written by `tests/blackbox_builder.py` as the firmware writes it, without the one
encoding that orangebox 0.5.0 does not decode (10, TAG2_3SVARIABLE: it puts the word TODO there and
ends with a TypeError). FLIGHTID_BLACKBOX names a file of yours. Rows are
matched by their count of loops.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from orangebox import Parser  # type: ignore[import-not-found]
from tests.blackbox_builder import FIELDS, blackbox

from flightid import _native
from flightid.reading import memory_budget
from flightid.table import Column, Table

Columns = dict[str, NDArray[np.float64]]
FRAMES, LOOP_S = 24_000, 500e-6
LEAST = {"rcCommand[3]": 1070, "motor": 158}
WRITTEN = tuple(replace(f, line=(f.line[0], 0)) if f.line[1] == 10 else f for f in FIELDS)


def run() -> Table:
    """Megabytes for each second of processor time, and how many values agree."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(os.environ.get("FLIGHTID_BLACKBOX") or _written(Path(folder) / "written.bbl"))
        size = path.stat().st_size / 1e6
        ours_s, ours = _timed(lambda: _ours(path), 5)
        theirs_s, theirs = _timed(lambda: _theirs(path), 1)
    compared, different, missing = differences(ours, theirs)
    columns = (
        Column("log"),
        Column("size", "MB", 3),
        Column("values compared"),
        Column("different"),
        Column("rows that orangebox lacks"),
        Column("flightid", "MB/s", 3),
        Column("orangebox", "MB/s", 3),
        Column("ratio", "", 3),
    )
    row = (
        path.name,
        size,
        compared,
        different,
        missing,
        size / ours_s,
        size / theirs_s,
        theirs_s / ours_s,
    )
    return Table("Betaflight blackbox to columns, one core", columns, (row,))


def differences(ours: Columns, theirs: Columns) -> tuple[int, int, int]:
    """Values that both have, how many of them differ, and rows that only flightid has."""
    loops = "loopIteration"
    _, mine, its = np.intersect1d(ours[loops], theirs[loops], return_indices=True)
    names = sorted(set(ours) & set(theirs))
    different = sum(int(np.count_nonzero(ours[name][mine] != theirs[name][its])) for name in names)
    return len(names) * mine.size, different, ours[loops].size - mine.size


def _ours(path: Path) -> Columns:
    log = _native.Blackbox(path.read_bytes(), 0, memory_budget())
    (columns,) = (names for table, names, _ in log.tables() if table == "main")
    return {name: log.numbers("main", place) for place, name in enumerate(columns)}


def _theirs(path: Path) -> Columns:
    parser = Parser.load(str(path))
    names = parser.field_names
    rows = [frame.data[: len(FIELDS)] for frame in parser.frames()]
    table = np.array(rows, dtype=np.float64)
    return {name: table[:, place] for place, name in enumerate(names[: table.shape[1]])}


def _timed(work: Callable[[], Columns], repeats: int) -> tuple[float, Columns]:
    """Least processor time, and what was read."""
    times, found = [], {}
    for _ in range(repeats):
        begun = time.process_time()
        found = work()
        times.append(time.process_time() - begun)
    return min(times), found


def _written(path: Path) -> Path:
    """Frames whose values reach every width that the encodings have below 32 bits.

    Throttle and motors stand above what the firmware predicts from, as they do in flight; the first
    frame is a whole one, as the firmware's is (orangebox takes others for a part of the header).
    """
    rng = np.random.default_rng(0)
    columns = {}
    for known in FIELDS[2:]:
        values = np.round(rng.normal(0.0, 300.0, FRAMES)).astype(int)
        least = next((floor for name, floor in LEAST.items() if known.name.startswith(name)), 0)
        columns[known.name] = values if known.signed else least + np.abs(values)
    columns["vbatLatest"] = 1600 - columns["vbatLatest"] // 10
    columns["time"] = 10_000_000 + np.round(np.arange(FRAMES) * LOOP_S * 1e6).astype(int)
    head, _, frames = blackbox(columns, fields=WRITTEN).partition(b"\nS\x02\x00")
    path.write_bytes(head + b"\n" + frames)
    return path


if __name__ == "__main__":
    print(run())
