"""Logs on this machine alone: a few sandboxes, each in a thread."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from queue import SimpleQueue

from flightid.fleet.engine.order import LogOrder, LogOutcome, RunOrder
from flightid.fleet.engine.sandbox import Sandbox

WINDOW = 4
"""Logs in flight for each worker."""


def machine_workers() -> int:
    """Processors that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def run_plain(
    order: RunOrder, logs: Iterable[LogOrder], workers: int | None = None
) -> Iterator[LogOutcome]:
    """Take logs in processes of this machine.

    Parameters
    ----------
    order : RunOrder
    logs : iterable of LogOrder
        Taken as room is made: it may be long.
    workers : int, optional
        Processes; default: one a processor.

    Yields
    ------
    LogOutcome
        As they are done.
    """
    count = workers or machine_workers()
    boxes = [Sandbox(order) for _ in range(count)]
    free: SimpleQueue[Sandbox] = SimpleQueue()
    for box in boxes:
        free.put(box)

    def take(log: LogOrder) -> LogOutcome:
        box = free.get()
        try:
            return box.run(log)
        finally:
            free.put(box)

    pool = ThreadPoolExecutor(count, "flightid-fleet")
    flying: set[Future[LogOutcome]] = set()
    try:
        for log in logs:
            flying.add(pool.submit(take, log))
            if len(flying) >= WINDOW * count:
                done, flying = wait(flying, return_when=FIRST_COMPLETED)
                yield from (each.result() for each in done)
        while flying:
            done, flying = wait(flying, return_when=FIRST_COMPLETED)
            yield from (each.result() for each in done)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for box in boxes:
            box.close()
