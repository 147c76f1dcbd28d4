"""A fleet's run beside a plain loop: throughput, overhead, memory of a worker, catalogue.

FLIGHTID_FLEET_LOGS says how many logs are flown (default 40; 1,000 take half an hour). The
processor time of a log by itself is measured inside the process that takes it, where nothing of the
fleet is; what a run costs beyond their sum is its overhead, that of starting processes apart.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from time import monotonic, sleep

from flightid import fleet
from flightid.fleet.addresses import find_logs
from flightid.fleet.run_one import LogTask, run_one
from flightid.fleet.settings import read_fleet
from flightid.table import Column, Table

EXAMPLE = Path(__file__).parents[1] / "examples" / "fleet"
FLIGHTS = 10
SAMPLE = 20
"""Logs of the plain loop."""


def run() -> Table:
    """One and two workers, and the plain loop, over the same logs."""
    count = int(os.environ.get("FLIGHTID_FLEET_LOGS", "40"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        flown(folder, count)
        rows = [_plain(folder / "fleet.toml")]
        start_s = _start(folder)
        runs = (2, 1) if count <= 200 else (2,)
        rows += [_taken(folder, workers, start_s) for workers in runs]
    columns = (
        *(Column("run"), Column("logs"), Column("fitted")),
        *(Column("wall", "s", 4), Column("processor", "s", 4), Column("logs a minute", "", 3)),
        *(Column("a log alone", "s", 3), Column("overhead", "%", 2)),
        *(Column("memory a worker", "MB", 3), Column("catalogue", "MB", 3)),
    )
    note = (
        f"Starting a cluster of two workers and their processes took {start_s:.1f} s of processor."
    )
    return Table("Fleet beside a plain loop", columns, tuple(rows), (note,))


def flown(folder: Path, count: int) -> Path:
    """The example's fleet with so many logs; the fleet file."""
    for name in ("fleet.toml", "study.toml"):
        shutil.copy(EXAMPLE / name, folder)
    vehicles = max(count // FLIGHTS, 1)
    command = [sys.executable, str(EXAMPLE / "fly.py"), str(folder / "logs")]
    subprocess.run([*command, str(vehicles), str(count // vehicles)], check=True)
    return folder / "fleet.toml"


def _used() -> float:
    own, below = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return own.ru_utime + own.ru_stime + below.ru_utime + below.ru_stime


def _plain(path: Path) -> tuple[object, ...]:
    """The same work in a loop of this process, the first log apart: it loads the libraries."""
    task = LogTask(read_fleet(path))
    logs = find_logs([str(path.parent / "logs")])[: SAMPLE + 1]
    run_one(logs[0], task)
    begun, used = monotonic(), _used()
    found = [run_one(each, task) for each in logs[1:]]
    wall_s, used_s = monotonic() - begun, _used() - used
    n = len(found)
    fitted = sum(each is not None and each.outcome == "fitted" for each in found)
    rate = 60.0 * n / used_s
    return ("plain loop", n, fitted, wall_s, used_s, rate, used_s / n, None, None, None)


def _start(folder: Path) -> float:
    """Processor time of a run over logs that are refused at once: processes, libraries, cluster."""
    place = folder / "start"
    (place / "logs").mkdir(parents=True)
    for name in ("fleet.toml", "study.toml"):
        shutil.copy(folder / name, place)
    for number in range(4):
        (place / "logs" / f"V{number:02}-20260301.bin").write_bytes(b"no log %d" % number)
    return _run(place / "fleet.toml", 2)[1]


def _run(path: Path, workers: int) -> tuple[float, float, int]:
    """Wall and processor time of a run in a process of its own, and the largest worker's memory."""
    begun, used, most = monotonic(), _used(), 0
    command = [sys.executable, "-m", "flightid", "fleet", "run", str(path)]
    running = subprocess.Popen(
        [*command, "--workers", str(workers)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    over = threading.Event()

    def watch() -> None:
        nonlocal most
        while not over.is_set():
            most = max(most, _workers_bytes(running.pid))
            sleep(2.0)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    running.wait()
    over.set()
    watcher.join()
    return monotonic() - begun, _used() - used, most


def _workers_bytes(pid: int) -> int:
    """Largest resident memory of a Dask worker below a process, its log process included."""
    import psutil  # noqa: PLC0415 - comes with Dask

    most = 0
    try:
        for each in psutil.Process(pid).children(recursive=True):
            below = each.children()
            if any("engine.child" in " ".join(child.cmdline()) for child in below):
                most = max(most, each.memory_info().rss + sum(c.memory_info().rss for c in below))
    except psutil.Error:
        return most
    return most


def _taken(folder: Path, workers: int, start_s: float) -> tuple[object, ...]:
    path = folder / "fleet.toml"
    wall_s, used_s, most = _run(path, workers)
    status = fleet.fleet_status(path)
    with fleet.open(path) as catalogue:
        ((alone_s,),) = catalogue.query("SELECT sum(processor_s) FROM logs").fetchall()
    size = status.n_bytes / 1e6
    n, fitted = status.n_logs, status.outcomes.get("fitted", 0)
    overhead = 100.0 * ((used_s - start_s) / alone_s - 1.0)
    shutil.rmtree(read_fleet(path).catalogue)
    name = f"{workers} worker{'s' * (workers > 1)}"
    rate = 60.0 * n / wall_s
    return (name, n, fitted, wall_s, used_s, rate, alone_s / n, overhead, most / 1e6, size)
