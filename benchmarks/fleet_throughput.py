"""A fleet's run beside a plain loop: throughput, overhead, memory of a worker, catalogue.

FLIGHTID_FLEET_LOGS says how many logs are flown (default 40; 1,000 take half an hour), and
FLIGHTID_FLEET_FEW with how many of them one worker and two clients are held beside two workers
(default 60). Each row is printed as soon as it is there. FLIGHTID_FLEET_FOLDER names a folder that
is kept: with it a benchmark that was cut takes up where it was.

The processor time of a log by itself is measured inside the process that takes it, where nothing of
the fleet is; what a run costs beyond their sum is its overhead, that of starting processes apart.
Processor time of a run is that of its processes, each read while it lives.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
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
KEPT_EVERY_S = 5.0
"""Seconds between notes of what a run has used, for whoever takes it up."""
COLUMNS = (
    *(Column("run"), Column("logs"), Column("fitted")),
    *(Column("wall", "s", 4), Column("processor", "s", 4), Column("logs a minute", "", 3)),
    *(Column("a log alone", "s", 3), Column("overhead", "%", 2)),
    *(Column("memory a worker", "MB", 3), Column("catalogue", "MB", 3)),
)


@dataclass(frozen=True)
class Trial:
    """One row: so many clients of so many workers over a set of logs."""

    logs: str
    workers: int
    clients: int

    def __str__(self) -> str:
        each = f"{self.workers} worker{'s' * (self.workers > 1)}"
        named = each if self.clients == 1 else f"{self.clients} clients of {each}"
        return f"{named}, {self.logs} logs"


@dataclass
class Usage:
    """What a run took: times, the largest worker's memory, how its clients ended, how often cut."""

    wall_s: float = 0.0
    used_s: float = 0.0
    most_bytes: int = 0
    parts: int = 0
    codes: list[int] = field(default_factory=list)

    def __add__(self, other: Usage) -> Usage:
        return Usage(
            self.wall_s + other.wall_s,
            self.used_s + other.used_s,
            max(self.most_bytes, other.most_bytes),
            self.parts + other.parts,
            other.codes,
        )


class Notes:
    """What is done already, in a file of the folder: rows, and what cut runs have used."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "notes.json"
        self.held = json.loads(self.path.read_text()) if self.path.exists() else {}

    def get(self, name: str) -> list[object] | None:
        """A finished row, or what was kept of a run."""
        return self.held.get(name)

    def keep(self, name: str, found: object) -> None:
        """Write it down; a cut while writing leaves the file of before."""
        self.held[name] = found
        beside = self.path.with_suffix(".new")
        beside.write_text(json.dumps(self.held))
        beside.replace(self.path)


def run() -> Table:
    """The plain loop, two workers beside one and beside two clients, then all logs."""
    count = int(os.environ.get("FLIGHTID_FLEET_LOGS", "40"))
    few = min(int(os.environ.get("FLIGHTID_FLEET_FEW", "60")), count)
    # Ended by its number alone, its clients would go on by themselves.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    with _folder() as folder:
        notes, files = Notes(folder), _files(folder, count, few)
        rows = [_told(notes, "plain loop", lambda: _plain(files["few"]))]
        whole = [Trial("all", 2, 1)] if few < count else []
        trials = [Trial("few", 2, 1), Trial("few", 1, 1), *whole, Trial("few", 1, 2)]
        for trial in trials:
            row = _told(notes, str(trial), lambda t=trial: _taken(files[t.logs], t, notes))
            rows.append(row)
    note = "Wall, processor and logs a minute are without starting cluster and processes."
    return Table("Fleet beside a plain loop", COLUMNS, tuple(rows), (note,))


@contextmanager
def _folder() -> Iterator[Path]:
    """The folder that was named, else one that goes with the benchmark."""
    kept = os.environ.get("FLIGHTID_FLEET_FOLDER")
    if kept:
        Path(kept).mkdir(parents=True, exist_ok=True)
        yield Path(kept).absolute()
        return
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def _told(notes: Notes, name: str, measure: object) -> tuple[object, ...]:
    """A row, measured where it is not there yet, and printed."""
    row = notes.get(f"row: {name}")
    if row is None:
        row = list(measure())
        notes.keep(f"row: {name}", row)
    print(Table(name, COLUMNS, (tuple(row),)), flush=True)
    return tuple(row)


def _files(folder: Path, count: int, few: int) -> dict[str, Path]:
    """Fleet files of all logs and of the first few, flown where they are not there yet."""
    whole, part = folder / "all", folder / "few"
    if not (whole / "flown").exists():
        shutil.rmtree(whole, ignore_errors=True)
        whole.mkdir()
        flown(whole, count)
        (whole / "flown").touch()
    if not (part / "fleet.toml").exists():
        (part / "logs").mkdir(parents=True, exist_ok=True)
        for log in sorted((whole / "logs").glob("*.bin"))[:few]:
            (part / "logs" / log.name).unlink(missing_ok=True)
            os.link(log, part / "logs" / log.name)
        _settings(part)
    return {"all": whole / "fleet.toml", "few": part / "fleet.toml"}


def _settings(folder: Path) -> None:
    for name in ("study.toml", "fleet.toml"):
        shutil.copy(EXAMPLE / name, folder)


def flown(folder: Path, count: int) -> Path:
    """The example's fleet with so many logs; the fleet file."""
    _settings(folder)
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


def _start(path: Path, trial: Trial) -> Usage:
    """A run over logs that are refused at once: processes, libraries, cluster."""
    place = path.parent / "start"
    shutil.rmtree(place, ignore_errors=True)
    (place / "logs").mkdir(parents=True)
    _settings(place)
    for number in range(4):
        (place / "logs" / f"V{number:02}-20260301.bin").write_bytes(b"no log %d" % number)
    *_, found = _run(place / "fleet.toml", trial)
    shutil.rmtree(place)
    return found


def _run(path: Path, trial: Trial) -> Iterator[Usage]:
    """A run in processes of its own, all clients at once; what it has used so far, and at last."""
    begun = monotonic()
    command = [sys.executable, "-m", "flightid", "fleet", "run", str(path)]
    command += ["--workers", str(trial.workers)]
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    running = [subprocess.Popen(command, **silent) for _ in range(trial.clients)]
    used, most = dict[tuple[int, float], float](), 0
    try:
        while any(each.poll() is None for each in running):
            for each in running:
                most = max(most, _workers_bytes(each.pid))
                used |= _times(each.pid)
            sleep(0.25)
            yield Usage(monotonic() - begun, sum(used.values()), most, 1)
    finally:
        for each in running:
            each.terminate()
    codes = [each.wait() for each in running]
    yield Usage(monotonic() - begun, sum(used.values()), most, 1, codes)


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


def _taken(path: Path, trial: Trial, notes: Notes) -> tuple[object, ...]:
    """The row of a trial; what it used before it was cut counts, each start apart."""
    name = f"used: {trial}"
    start, before = _start(path, trial), Usage(**(notes.get(name) or {}))
    usage, kept_s = before, 0.0
    for now in _run(path, trial):
        usage = before + now
        if now.wall_s > kept_s + KEPT_EVERY_S:
            kept_s = now.wall_s
            notes.keep(name, asdict(usage))
    notes.keep(name, asdict(usage))
    return _row(path, trial, start, usage)


def _row(path: Path, trial: Trial, start: Usage, usage: Usage) -> tuple[object, ...]:
    status = fleet.fleet_status(path)
    with fleet.open(path) as catalogue:
        ((alone_s, rows, logs),) = catalogue.query(
            "SELECT sum(processor_s), count(*), count(DISTINCT log) FROM logs"
        ).fetchall()
    assert rows == logs, "a log counts twice"
    size = status.n_bytes / 1e6
    n, fitted = status.n_logs, status.outcomes.get("fitted", 0)
    wall_s = usage.wall_s - usage.parts * start.wall_s
    used_s = usage.used_s - usage.parts * start.used_s
    overhead = 100.0 * (used_s / alone_s - 1.0)
    shutil.rmtree(read_fleet(path).catalogue)
    name = str(trial).rpartition(",")[0]
    if usage.parts > 1:
        name = f"{name}, in {usage.parts} parts"
    if any(usage.codes):
        name = f"{name}, ended with {', '.join(map(str, usage.codes))}"
    most = usage.most_bytes / 1e6
    return (name, n, fitted, wall_s, used_s, 60.0 * n / wall_s, alone_s / n, overhead, most, size)
