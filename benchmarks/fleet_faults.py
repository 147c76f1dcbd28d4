"""What a run of a fleet loses where something is ended with -9 at random, or the disk is full.

Each row: logs in the catalogue when it happened, how the run ended, what was there afterwards, and
what the next run still had to take. Lost are logs that were in the catalogue when it happened and
are not there afterwards; failed, those that stand in it as failures at the end.
FLIGHTID_FLEET_LOGS says how many logs a run has (default 40, refused at once; every fourth real),
FLIGHTID_FLEET_FAULTS a word of the faults that are tried (default: all).
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from time import monotonic, sleep

from benchmarks.fleet_throughput import EXAMPLE
from flightid import fleet
from flightid.errors import DataError
from flightid.table import Column, Table

PATIENCE_S = 300.0


def run() -> Table:
    """One row a fault."""
    count, draws = int(os.environ.get("FLIGHTID_FLEET_LOGS", "40")), random.Random(1)
    wanted = os.environ.get("FLIGHTID_FLEET_FAULTS", "")
    faults: dict[str, Callable[[Path, int, random.Random], tuple[object, ...]]] = {
        "log process": _killed("process"),
        "worker": _killed("worker"),
        "client, with scheduler and nannies": _killed("client"),
        "nanny, by tcp": _by_address("nanny"),
        "scheduler, by tcp": _by_address("scheduler"),
        "full disk": _full_disk,
        "hanging and greedy logs": _misbehaved,
    }
    rows = []
    for name, fault in faults.items():
        if wanted not in name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                rows.append((name, *fault(Path(folder), count, draws)))
            except (OSError, subprocess.SubprocessError, AssertionError, DataError) as error:
                rows.append((name, None, str(error)[:80], *(None,) * 5))
            print(*rows[-1], sep="  ", flush=True)
    columns = (
        *(Column("ended"), Column("done then"), Column("exit code"), Column("done after")),
        *(Column("lost"), Column("taken by the next run"), Column("its time", "s", 3)),
        Column("failed"),
    )
    return Table(f"Faults in runs of {count} logs", columns, tuple(rows))


def _fleet(folder: Path, count: int, extra: str = "") -> Path:
    for name in ("fleet.toml", "study.toml"):
        shutil.copy(EXAMPLE / name, folder)
    if extra:
        path = folder / "fleet.toml"
        path.write_text(path.read_text().replace("time_s = 300", extra))
    real = max(count // 4, 1)
    command = [sys.executable, str(EXAMPLE / "fly.py"), str(folder / "logs"), "1", str(real)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    for number in range(count - real):
        path = folder / "logs" / f"V{number % 9 + 1:02}-2026{number % 12 + 1:02}01-{number}.bin"
        path.write_bytes(b"no log %d" % number)
    return folder / "fleet.toml"


def _begun(path: Path, *options: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "flightid", "fleet", "run", str(path), *options]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _done(path: Path) -> int:
    try:
        return fleet.fleet_status(path).n_logs
    except DataError:
        return 0


def _logs(path: Path) -> set[str]:
    """Digests of the logs in the catalogue."""
    try:
        with fleet.open(path) as catalogue:
            return {log for (log,) in catalogue.query("SELECT log FROM logs").fetchall()}
    except DataError:
        return set()


def _until(path: Path, running: subprocess.Popen[bytes], count: int) -> set[str]:
    """Wait until so many logs are done, or the run is over; which."""
    deadline = monotonic() + PATIENCE_S
    while _done(path) < count and running.poll() is None and monotonic() < deadline:
        sleep(0.05)
    return _logs(path)


def _finished(
    path: Path, running: subprocess.Popen[bytes], then: set[str], count: int
) -> tuple[object, ...]:
    """How the run ended, and what the next one took."""
    try:
        code = running.wait(timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        running.kill()
        raise
    after = _logs(path)
    begun = monotonic()
    again = fleet.run_fleet(path, workers=2)
    took_s = monotonic() - begun
    assert _done(path) == count, f"{_done(path)} of {count} logs in the catalogue at the end"
    with fleet.open(path) as catalogue:
        ((rows, logs, failed),) = catalogue.query(
            "SELECT count(*), count(DISTINCT log), count_if(outcome = 'failed') FROM logs"
        ).fetchall()
    assert rows == logs, "a log counts twice"
    taken = sum(again.outcomes.values())
    return len(then), code, len(after), len(then - after), taken, took_s, failed


def _killed(victim: str) -> Callable[[Path, int, random.Random], tuple[object, ...]]:
    def fault(folder: Path, count: int, draws: random.Random) -> tuple[object, ...]:
        path = _fleet(folder, count)
        running = _begun(path, "--workers", "2")
        then = _until(path, running, draws.randrange(2, count // 2))
        for pid in _victims(running.pid, victim)[:1]:
            os.kill(pid, signal.SIGKILL)
        return _finished(path, running, then, count)

    return fault


def _victims(pid: int, kind: str) -> list[int]:
    """Processes of a run on a cluster of this machine: scheduler and nannies are the client's."""
    import psutil  # noqa: PLC0415 - comes with Dask

    below = psutil.Process(pid).children(recursive=True)
    logs = [each for each in below if "engine.child" in " ".join(each.cmdline())]
    if kind == "process":
        return [each.pid for each in logs]
    if kind == "worker":
        return [each.ppid() for each in logs]
    return [pid]


def _dask(*arguments: str) -> subprocess.Popen[bytes]:
    kind, *rest = arguments
    command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *rest, "--no-dashboard"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _by_address(victim: str) -> Callable[[Path, int, random.Random], tuple[object, ...]]:
    """Scheduler and two workers, each with its nanny, as processes of their own."""

    def fault(folder: Path, count: int, draws: random.Random) -> tuple[object, ...]:
        path, port = _fleet(folder, count), draws.randrange(20_000, 30_000)
        address = f"tcp://127.0.0.1:{port}"
        scheduler = _dask("scheduler", "--host", "127.0.0.1", "--port", str(port))
        own = ("worker", address, "--nthreads", "1", "--death-timeout", "30")
        nannies = [_dask(*own) for _ in range(2)]
        try:
            running = _begun(path, "--scheduler", address)
            then = _until(path, running, draws.randrange(2, count // 2))
            (scheduler if victim == "scheduler" else nannies[0]).kill()
            return _finished(path, running, then, count)
        finally:
            for process in (*nannies, scheduler):
                process.terminate()
            for process in (*nannies, scheduler):
                process.wait(timeout=60)

    return fault


def _full_disk(folder: Path, count: int, draws: random.Random) -> tuple[object, ...]:
    del draws
    disk = folder / "disk"
    disk.mkdir()
    size = ["-o", "size=160k"]
    subprocess.run(["mount", "-t", "tmpfs", *size, "tmpfs", str(disk)], check=True)
    try:
        path = _fleet(folder, count)
        place = f'study = "study.toml"\ncatalogue = "{disk}/catalogue"'
        path.write_text(path.read_text().replace('study = "study.toml"', place))
        running = _begun(path, "--workers", "2")
        running.wait(timeout=PATIENCE_S)
        then = _logs(path)
        subprocess.run(["mount", "-o", "remount,size=64m", str(disk)], check=True)
        return _finished(path, running, then, count)
    finally:
        subprocess.run(["umount", str(disk)], check=False)


class _Silent(BaseHTTPRequestHandler):
    """A store that says how long a log is and then hands over none of it."""

    def do_HEAD(self) -> None:
        """Answer at once."""
        self.send_response(200)
        self.send_header("Content-Length", "1000000")
        self.end_headers()

    def do_GET(self) -> None:
        """Hang for longer than any run."""
        self.do_HEAD()
        sleep(2.0 * PATIENCE_S)

    def log_message(self, *_: object) -> None:
        """Nothing is printed."""


def _misbehaved(folder: Path, count: int, draws: random.Random) -> tuple[object, ...]:
    """A log whose store hangs, and one too long for its process's memory."""
    del draws
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Silent)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    path = _fleet(folder, count - 2, "time_s = 20\nmemory_mib = 900")
    hangs = f"http://127.0.0.1:{server.server_address[1]}/V01-20260102-hangs.bin"
    path.write_text(path.read_text().replace('logs = ["logs"]', f'logs = ["logs", "{hangs}"]'))
    with (folder / "logs" / "V01-20260101-long.bin").open("wb") as file:
        shutil.copyfileobj((folder / "logs" / "V00-2026-01-05.bin").open("rb"), file)
        file.truncate(1 << 30)
    try:
        running = _begun(path, "--workers", "2")
        then = _until(path, running, count)
        return _finished(path, running, then, count)
    finally:
        server.shutdown()
