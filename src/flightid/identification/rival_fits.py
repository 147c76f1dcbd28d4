"""Fits that are made beside a fit and only for their estimates: nothing judges them further."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_ESTIMATES_ALONE: ContextVar[bool] = ContextVar("estimates_alone", default=False)


@contextmanager
def estimates_alone() -> Iterator[None]:
    """Inside, methods leave out findings that cost as much as the fit.

    Example
    -------
    >>> with estimates_alone():
    ...     print(judged())
    False
    """
    token = _ESTIMATES_ALONE.set(True)
    try:
        yield
    finally:
        _ESTIMATES_ALONE.reset(token)


def judged() -> bool:
    """Whether a fit is to say what is known of it, its estimates apart."""
    return not _ESTIMATES_ALONE.get()
