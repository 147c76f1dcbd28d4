"""Worker processes of one purpose, begun anew where somebody has killed one that had no work.

A pool of pebble is of no use any more when an idle worker of it ends without being asked: it then
refuses everything until the server ends.
"""

from __future__ import annotations

import multiprocessing
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import Any

from pebble import ProcessPool

from flightid.app import work

NEEDED = tuple(
    f"flightid.app.{name}"
    for name in ("work", "gain_work", "rig_work", "compare_work", "model_work", "run_work")
)
"""Modules of the work that processes are begun for."""
WATCH_S = 0.5
"""Between looks at pools that may have broken."""


class Crew:
    """Processes that wait for work.

    Parameters
    ----------
    shared : Path
        Folder through which they share what took long.
    size : int
        How many.
    """

    def __init__(self, shared: Path, size: int = 1) -> None:
        self._shared, self._size = shared, size
        self._lock = threading.Lock()
        self._begun: dict[Future[Any], ProcessPool] = {}
        self._ended = threading.Event()
        self._pool = self._made()
        threading.Thread(target=self._watch, daemon=True).start()

    def schedule(
        self, call: Callable[..., Any], *inputs: object, timeout_s: float | None = None
    ) -> Future[Any]:
        """Begin work; its future fails as those of pebble do: TimeoutError, ProcessExpired.

        It fails with BrokenProcessPool where a process was killed before it took the work.

        Raises
        ------
        BrokenProcessPool
            Processes cannot be started at all.
        """
        with self._lock:
            for _ in range(2):
                with suppress(RuntimeError):
                    future: Future[Any] = self._pool.schedule(call, args=inputs, timeout=timeout_s)
                    self._begun[future] = self._pool
                    return future
                self._replace()
        raise BrokenProcessPool("no worker can be started")

    def stop(self) -> None:
        """End all of them, with what they do; `join` waits for it."""
        self._ended.set()
        self._pool.stop()

    def join(self) -> None:
        """Wait until all that were stopped have ended."""
        self._pool.join()

    def _watch(self) -> None:
        """Fail what a broken pool has taken: of its queue nothing is ever heard again."""
        while not self._ended.wait(WATCH_S):
            with self._lock:
                self._begun = {f: pool for f, pool in self._begun.items() if not f.done()}
                lost = [future for future, pool in self._begun.items() if not pool.active]
                if lost and not self._ended.is_set() and not self._pool.active:
                    self._replace()
            for future in lost:
                with suppress(InvalidStateError):
                    future.set_exception(BrokenProcessPool("a worker was killed"))

    def _replace(self) -> None:
        self._pool.stop()
        self._pool.join()
        self._pool = self._made()

    def _made(self) -> ProcessPool:
        return ProcessPool(
            self._size, context=_context(), initializer=work.begin, initargs=(self._shared,)
        )


def _context() -> BaseContext:
    """Processes of their own state: a fork of one with threads may hold a lock for good.

    On Linux they are forks of a server without threads, which has imported once what all of them
    need: six take 1.2 s of processor time in place of 4.4 s, and share the memory of what was
    imported. Elsewhere each imports for itself (macOS' own libraries are not safe behind a fork).
    """
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(NEEDED))
    return context
