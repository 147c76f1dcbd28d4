"""A fleet's run beside a plain loop: throughput, overhead, memory of a worker, catalogue.

FLIGHTID_FLEET_LOGS says how many logs are flown (default 40; 1,000 take half an hour). The
processor time of a log by itself is measured inside the process that takes it, where nothing of the
fleet is; what a run costs beyond their sum is its overhead, that of starting processes apart.
Processor time of a run is that of its processes, each read while it lives: a run whose client is
ended with -9 has its row too, of what was done until then, and is named so.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
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
    """One and two workers, two clients, and the plain loop, over the same logs."""
    count = int(os.environ.get("FLIGHTID_FLEET_LOGS", "40"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        flown(folder, count)
        rows = [_plain(folder / "fleet.toml")]
        starts = {each: _start(folder, *each) for each in ((2, 1), (1, 1), (1, 2))}
        for each, start in starts.items() if count <= 200 else [((2, 1), starts[2, 1])]:
            rows.append(_taken(folder, *each, start))
    columns = (
        *(Column("run"), Column("logs"), Column("fitted")),
        *(Column("wall", "s", 4), Column("processor", "s", 4), Column("logs a minute", "", 3)),
        *(Column("a log alone", "s", 3), Column("overhead", "%", 2)),
        *(Column("memory a worker", "MB", 3), Column("catalogue", "MB", 3)),
    )
    told = "; ".join(
        f"{_named(*each)}: {start.wall_s:.1f} s, {start.used_s:.1f} s of processor"
        for each, start in starts.items()
    )
    note = f"Wall, processor and logs a minute are without starting, which took {told}."
    return Table("Fleet beside a plain loop", columns, tuple(rows), (note,))


@dataclass(frozen=True)
class Usage:
    """What a run took: times, the largest worker's memory, how its clients ended."""

    wall_s: float
    used_s: float
    most_bytes: int
    codes: tuple[int, ...]


def _named(workers: int, clients: int) -> str:
    each = f"{workers} worker{'s' * (workers > 1)}"
    return each if clients == 1 else f"{clients} clients of {each}"


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


def _start(folder: Path, workers: int, clients: int) -> Usage:
    """A run over logs that are refused at once: processes, libraries, cluster."""
    place = folder / "start"
    (place / "logs").mkdir(parents=True)
    for name in ("fleet.toml", "study.toml"):
        shutil.copy(folder / name, place)
    for number in range(4):
        (place / "logs" / f"V{number:02}-20260301.bin").write_bytes(b"no log %d" % number)
    found = _run(place / "fleet.toml", workers, clients)
    shutil.rmtree(place)
    return found


def _run(path: Path, workers: int, clients: int) -> Usage:
    """A run in processes of its own, all clients at once."""
    begun = monotonic()
    command = [sys.executable, "-m", "flightid", "fleet", "run", str(path)]
    running = [
        subprocess.Popen(
            [*command, "--workers", str(workers)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for _ in range(clients)
    ]
    used, most = dict[tuple[int, float], float](), 0
    while any(each.poll() is None for each in running):
        for each in running:
            most = max(most, _workers_bytes(each.pid))
            used |= _times(each.pid)
        sleep(0.25)
    return Usage(
        monotonic() - begun, sum(used.values()), most, tuple(each.wait() for each in running)
    )


def _times(pid: int) -> dict[tuple[int, float], float]:
    """Processor time so far of a process and of all below it, each by itself."""
    import psutil  # noqa: PLC0415 - comes with Dask

    found = {}
    try:
        top = psutil.Process(pid)
        for each in (top, *top.children(recursive=True)):
            times = each.cpu_times()
            found[each.pid, each.create_time()] = times.user + times.system
    except psutil.Error:
        return found
    return found


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


def _taken(folder: Path, workers: int, clients: int, start: Usage) -> tuple[object, ...]:
    path = folder / "fleet.toml"
    usage = _run(path, workers, clients)
    status = fleet.fleet_status(path)
    with fleet.open(path) as catalogue:
        ((alone_s, rows, logs),) = catalogue.query(
            "SELECT sum(processor_s), count(*), count(DISTINCT log) FROM logs"
        ).fetchall()
    assert rows == logs, "a log counts twice"
    size = status.n_bytes / 1e6
    n, fitted = status.n_logs, status.outcomes.get("fitted", 0)
    wall_s, used_s = usage.wall_s - start.wall_s, usage.used_s - start.used_s
    overhead = 100.0 * (used_s / alone_s - 1.0)
    shutil.rmtree(read_fleet(path).catalogue)
    name = _named(workers, clients)
    if any(usage.codes):
        name = f"{name}, ended with {', '.join(map(str, usage.codes))}"
    rate = 60.0 * n / wall_s
    most = usage.most_bytes / 1e6
    return (name, n, fitted, wall_s, used_s, rate, alone_s / n, overhead, most, size)
