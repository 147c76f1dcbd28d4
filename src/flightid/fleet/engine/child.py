"""The process that takes logs: one line of JSON in, few out (``python -m …fleet.engine.child``).

It may hang, eat memory or die: its parent (`sandbox.py`) has the clock, the system the limit of
memory. Where the parent goes, it goes too.
"""

from __future__ import annotations

import faulthandler
import json
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from queue import SimpleQueue
from typing import Any, TextIO

from flightid.fleet.catalogue.loose import write_loose
from flightid.fleet.catalogue.parts import LiveLogs
from flightid.fleet.catalogue.store import store_at
from flightid.fleet.engine.order import KNOWN, SCRATCH, STORAGE, LogOrder, RunOrder
from flightid.fleet.identity import FleetTables
from flightid.fleet.run_one import FULL, LogTask, run_one
from flightid.fleet.settings import read_order

ORPHAN = 3
"""Exit code of a child whose parent is gone."""
GONE = threading.Event()
"""Set where the parent is: what fails from then on is no fault of a log."""
LONGER_S = 60.0
"""Time beyond its clock after which a process ends by itself: its parent could not end it."""


def limit_memory(mebibytes: int) -> None:
    """Most address space of this process; systems without such limits have none."""
    try:
        resource = import_module("resource")
    except ModuleNotFoundError:
        return
    limit = mebibytes << 20
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    soft = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def main() -> None:
    """Take logs until the parent closes its end."""
    # Lines go by a descriptor of their own: whatever prints cannot break them.
    said = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    lines: SimpleQueue[str] = SimpleQueue()
    threading.Thread(target=_listen, args=(lines,), daemon=True).start()
    order = json.loads(lines.get())
    # A library that finds no room later would seem the fault of a log: all load before the limit.
    room = import_module("flightid.fleet")
    for name in room.__all__:
        getattr(room, name)
    limit_memory(order["memory_mib"])
    with tempfile.TemporaryDirectory() as folder:
        try:
            take = _ready(order, Path(folder), said)
        except OSError as error:
            if error.errno not in FULL:
                raise
            _say(said, _full(error))
            return
        _say(said, {"ready": True})
        while True:
            _say(said, take(json.loads(lines.get())))


def _full(error: OSError) -> dict[str, Any]:
    return {"outcome": STORAGE, "log": "", "message": str(error)}


def _listen(lines: SimpleQueue[str]) -> None:
    for line in sys.stdin:
        lines.put(line)
    # The parent is gone or has had enough: nobody wants the rest.
    GONE.set()
    scratch = Path(tempfile.gettempdir())
    if scratch.name.startswith(SCRATCH):
        shutil.rmtree(scratch, ignore_errors=True)
    os._exit(ORPHAN)


def _say(said: TextIO, values: dict[str, Any]) -> None:
    said.write(json.dumps(values) + "\n")
    said.flush()


def _ready(
    values: dict[str, Any], folder: Path, said: TextIO
) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """What takes one log, everything that all need loaded before the first."""
    order = RunOrder(**values)
    settings = read_order(order.unpack(folder))
    store = store_at(order.place)
    known = LiveLogs(store)
    reports = None if order.reports is None else Path(order.reports)

    def tell(stage: str, log: str) -> None:
        _say(said, {"stage": stage, "log": log})

    def take(asked: dict[str, Any]) -> dict[str, Any]:
        each = LogOrder.from_dict(asked)
        tables = FleetTables(order.vehicles, {each.address.name: each.flight})
        task = LogTask(settings, tables, known, reports, tell)
        # A regular expression or a foreign library may hold the interpreter, and with it the thread
        # that listens for the parent's end; this clock needs neither.
        faulthandler.dump_traceback_later(order.time_s + LONGER_S, exit=True)
        try:
            record = run_one(each.address, task, attempts=each.attempts)
            if record is None:
                return {"outcome": KNOWN, "log": ""}
            if GONE.is_set():
                raise SystemExit(ORPHAN)
            write_loose(store, record)
        except OSError as error:
            if error.errno not in FULL:
                raise
            return _full(error)
        finally:
            faulthandler.cancel_dump_traceback_later()
        entry = record.rows["logs"][0]
        names = ("outcome", "log", "reason", "message", "memory_bytes", "action", "vehicle")
        return {name: entry.get(name) for name in names}

    return take


if __name__ == "__main__":
    main()
