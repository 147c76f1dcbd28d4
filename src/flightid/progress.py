"""Progress of long work: silent unless a display is installed, as the command line does.

A stage says what it does and how far it is; it knows no terminal. A display is a function that
takes a label and a total and returns a `Meter`; it decides when and how to show it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol, TypeVar

Item = TypeVar("Item")


class Meter(Protocol):
    """What a display returns for one piece of work."""

    def advance(self, steps: int = 1) -> None:
        """Count steps that are done."""

    def close(self) -> None:
        """End the work, finished or not."""


Display = Callable[[str, int | None], Meter]
"""Makes a meter from a label and the total number of steps (None: not known)."""

_display: ContextVar[Display | None] = ContextVar("flightid_progress_display", default=None)


class _Silence:
    def advance(self, steps: int = 1) -> None:
        """Nothing is shown."""

    def close(self) -> None:
        """Nothing was shown."""


@contextmanager
def shown_by(display: Display) -> Iterator[None]:
    """Install a display for the work inside the block.

    Parameters
    ----------
    display : callable
        Takes a label and a total (None where it is not known) and returns a `Meter`.
    """
    token = _display.set(display)
    try:
        yield
    finally:
        _display.reset(token)


@contextmanager
def progress(total: int | None, label: str) -> Iterator[Callable[..., None]]:
    """Announce work and count its steps; the meter is closed however the block ends.

    Parameters
    ----------
    total : int or None
        Number of steps; None where it is not known.
    label : str
        What is being done, for example ``"reading the log"``.

    Yields
    ------
    callable
        Call it after each step, or with a number of steps.

    Example
    -------
    >>> with progress(3, "counting") as advance:
    ...     for _ in range(3):
    ...         advance()
    """
    display = _display.get()
    meter: Meter = _Silence() if display is None else display(label, total)
    try:
        yield meter.advance
    finally:
        meter.close()


def track(items: Iterable[Item], label: str) -> Iterator[Item]:
    """Pass items on and count them.

    Parameters
    ----------
    items : iterable
        Work to do; its length is the total where it has one.
    label : str
        What is being done.

    Yields
    ------
    object
        Each item.

    Example
    -------
    >>> [2 * item for item in track((1, 2), "doubling")]
    [2, 4]
    """
    total = len(items) if isinstance(items, Sized) else None
    with progress(total, label) as advance:
        for item in items:
            yield item
            advance()
