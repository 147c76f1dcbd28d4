"""Memory of this process, bounded for as long as a stranger's question is answered."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flightid.reading import memory_budget

SPARE = 2
"""Budgets beyond what the process holds: DuckDB's own limit is one, its threads need room."""


@contextmanager
def bounded_memory() -> Iterator[None]:
    """Let this process take no more than twice the memory budget beyond what it has.

    DuckDB's own limit does not count what functions of one value make: a list of 2·10⁸ numbers
    took 14 GB and 44 s under a limit of 2 GB. On systems other than Linux nothing is bounded.

    Example
    -------
    >>> with bounded_memory():
    ...     sum(range(4))
    6
    """
    if not sys.platform.startswith("linux"):
        yield
        return
    import resource  # noqa: PLC0415 - Windows has none

    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    bound = pages * resource.getpagesize() + SPARE * memory_budget()
    before, hard = resource.getrlimit(resource.RLIMIT_AS)
    limits = [each for each in (bound, before, hard) if each != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_AS, (min(limits), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, hard))
