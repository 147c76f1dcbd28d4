"""Threads of the linear-algebra library: one, for commands and for verbs called from Python.

Matrices here are small and many. OpenBLAS's threads wait for them by spinning: `flightid tune` of a
log of 22 MB on two cores takes 15 s of processor time and 17 s by the clock with one thread, 32 and
28 s with two. One thread also sums in one order: numbers do not hang on the cores of a machine.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from threading import Lock
from typing import ParamSpec, TypeVar

Asked = ParamSpec("Asked")
Answer = TypeVar("Answer")

LINEAR_ALGEBRA = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables that linear-algebra libraries read when NumPy is loaded."""


def one_linear_algebra_thread() -> None:
    """Ask for one thread where the surroundings ask for no number; NumPy must not be loaded yet.

    Processes that are started later inherit it. The native half has threads of its own.
    """
    for name in LINEAR_ALGEBRA:
        os.environ.setdefault(name, "1")


def on_one_thread(verb: Callable[Asked, Answer]) -> Callable[Asked, Answer]:
    """A verb that holds the linear-algebra libraries to one thread while it works.

    A number of threads that the surroundings ask for is kept; so is, after the verb, whatever held
    before. The limit is the process's: a verb that begins while another is at work has that one's,
    and works on with as many threads as before where it outlives it.
    """

    @wraps(verb)
    def limited(*args: Asked.args, **options: Asked.kwargs) -> Answer:
        if any(name in os.environ for name in LINEAR_ALGEBRA) or not _AT_WORK.acquire(False):
            return verb(*args, **options)
        from threadpoolctl import threadpool_limits  # noqa: PLC0415 - commands never need it

        try:
            with threadpool_limits(1, user_api="blas"):
                return verb(*args, **options)
        finally:
            _AT_WORK.release()

    return limited


_AT_WORK = Lock()
"""Held by the verb that set the limit: what it calls, and other threads' verbs, set none."""
