"""Work on data that many fits of one structure have in common, done once for all of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar, cast

Made = TypeVar("Made")
MOST = 64
"""Results that are kept: data of one campaign agree in a few things, or in none."""
_KEPT: ContextVar[dict[Hashable, object] | None] = ContextVar("kept", default=None)


class Itself:
    """A thing as part of a key, equal to itself alone; it lives as long as the key does.

    Example
    -------
    >>> thing = {"a": 1}
    >>> Itself(thing) == Itself(thing), Itself(thing) == Itself({"a": 1})
    (True, False)
    """

    __slots__ = ("thing",)

    def __init__(self, thing: object) -> None:
        self.thing = thing

    def __eq__(self, other: object) -> bool:
        """Whether it is the same thing."""
        return isinstance(other, Itself) and other.thing is self.thing

    def __hash__(self) -> int:
        """As the thing's identity."""
        return id(self.thing)


@contextmanager
def shared_work() -> Iterator[None]:
    """Inside, what `shared` made for the same key is taken again.

    Example
    -------
    >>> with shared_work():
    ...     shared(lambda: "key", lambda: 1), shared(lambda: "key", lambda: 2)
    (1, 1)
    >>> shared(lambda: "key", lambda: 3)
    3
    """
    token = _KEPT.set({})
    try:
        yield
    finally:
        _KEPT.reset(token)


def shared(key: Callable[[], Hashable], make: Callable[[], Made]) -> Made:
    """What `make` makes, or has made for this key, which holds all that it depends on."""
    kept = _KEPT.get()
    if kept is None:
        return make()
    place = key()
    if place not in kept:
        if len(kept) >= MOST:
            kept.clear()
        kept[place] = make()
    return cast("Made", kept[place])
