"""Worker processes of one purpose, begun anew where somebody has killed one that had no work.

A pool of pebble is of no use any more when an idle worker of it ends without being asked: it then
refuses everything until the server ends.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any

from pebble import ProcessPool

from flightid.app import work


class Crew:
    """Processes that wait for work.

    Parameters
    ----------
    size : int
        How many.
    """

    def __init__(self, size: int = 1) -> None:
        self._size = size
        self._pool = self._begun()

    def schedule(
        self, call: Callable[..., Any], *inputs: object, timeout_s: float | None = None
    ) -> Future[Any]:
        """Begin work; its future fails as those of pebble do: TimeoutError, ProcessExpired.

        Raises
        ------
        BrokenProcessPool
            Processes cannot be started at all.
        """
        for _ in range(2):
            with suppress(RuntimeError):
                future: Future[Any] = self._pool.schedule(call, args=inputs, timeout=timeout_s)
                return future
            self.stop()
            self.join()
            self._pool = self._begun()
        raise BrokenProcessPool("no worker can be started")

    def stop(self) -> None:
        """End all of them, with what they do; `join` waits for it."""
        self._pool.stop()

    def join(self) -> None:
        """Wait until all that were stopped have ended."""
        self._pool.join()

    def _begun(self) -> ProcessPool:
        # A process of its own state: a fork of one with threads may hold a lock for good.
        context = multiprocessing.get_context("spawn")
        return ProcessPool(max_workers=self._size, context=context, initializer=work.limit_memory)
