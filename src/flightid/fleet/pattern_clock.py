"""The pattern of a fleet file against all names, on a clock: one that backtracks is told at once.

A regular expression such as ``^(a*)*_`` takes time that doubles with each letter of a name. In the
processes that take logs it would seem a log that hangs.
"""

from __future__ import annotations

import re
import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from types import FrameType

from flightid.errors import StudyError

NAME_S, LEAST_S = 1e-3, 2.0
"""Processor time for each name, and for all together at least, s."""


class _Overrun(Exception):  # noqa: N818 - it never leaves this file
    """The time is over."""


def require_quick(pattern: str | None, names: Iterable[str]) -> None:
    """Match all names once, in bounded time.

    Parameters
    ----------
    pattern : str or None
        None: nothing is matched.
    names : iterable of str
        File names.

    Raises
    ------
    StudyError
        A name takes too long, by name and pattern.
    """
    if pattern is None or not _has_clock():
        return
    every, expression, at = list(names), re.compile(pattern), ""
    try:
        with _clock(max(LEAST_S, NAME_S * len(every))):
            for at in every:
                expression.search(at)
    except _Overrun:
        raise StudyError(
            "fleet file, [vehicles]: pattern does not come to an end",
            found=f"{pattern!r} on the name {at!r}",
            needed="a pattern without repeats inside repeats, such as (a*)* or (a|a)*",
            action="write what stands between the parts, such as ^([A-Z]+[0-9]+)-",
        ) from None


def _has_clock() -> bool:
    """Whether this thread can be told that time is over: the main one, where there are timers."""
    is_main = threading.current_thread() is threading.main_thread()
    return is_main and hasattr(signal, "setitimer")


@contextmanager
def _clock(most_s: float) -> Iterator[None]:
    """Raise `_Overrun` after so much processor time of this process.

    A match looks at signals every few thousand steps. A clock that somebody else has set for this
    process goes on afterwards.
    """

    def over(_: int, __: FrameType | None) -> None:
        raise _Overrun

    before = signal.signal(signal.SIGVTALRM, over)
    others = signal.setitimer(signal.ITIMER_VIRTUAL, most_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, *others)
        signal.signal(signal.SIGVTALRM, signal.SIG_DFL if before is None else before)
