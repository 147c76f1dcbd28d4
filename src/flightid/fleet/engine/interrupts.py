"""Ctrl-C around a cluster: it waits while one is made or ended, and no worker ever hears of it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.resource_tracker import ensure_running
from types import FrameType


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C until the block is over; threads and processes begun in it never have it.

    A terminal sends it to every process of a run, and a worker that is ended by it prints where it
    stood. What begins here inherits that the signal is blocked, and so does what is begun by that.

    Raises
    ------
    KeyboardInterrupt
        After the block, where one came.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # No other thread has signals.
        return
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield  # As for a run behind a shell's `&`: who ignores it goes on doing so, workers too.
        return
    came: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        came.append(number)

    before = signal.signal(signal.SIGINT, note)
    try:
        with _blocked():
            yield
    finally:
        signal.signal(signal.SIGINT, before if before is not None else signal.default_int_handler)
    if came:
        raise KeyboardInterrupt


@contextmanager
def _blocked() -> Iterator[None]:
    """The signal blocked for this thread, where the system has that; one that came is seen then."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Begun later, by the first process that is spawned, it would lift the block of that thread.
    ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
