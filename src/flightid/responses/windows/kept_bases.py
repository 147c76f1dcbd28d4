"""Bases of windows that one piece of work asks for again and again, made once for all of it.

A fit of responses that takes out what windows add asks for the bases of the same windows at the
same frequencies at each of its searches, under each hold, and for its errors; a study asks again
for each axis, for errors that it shows and for its pictures. So it is with weights of windows, and
with the kernels that these make of noise.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from flightid.responses.windows.transform import FoldedBasis, WindowPlan

MOST_BYTES = 1 << 26
"""On one shelf: the bases of five windows at a hundred frequencies take less, as do the kernels of
five windows in a record of 130 s (10 MB)."""
Made = TypeVar("Made")


class _Shelf:
    """What is kept of one kind, and its bytes."""

    def __init__(self) -> None:
        self.held: dict[Hashable, object] = {}
        self.n_bytes = 0

    def clear(self) -> None:
        self.held.clear()
        self.n_bytes = 0


_KEPT: ContextVar[dict[str, _Shelf] | None] = ContextVar("kept_bases", default=None)


@contextmanager
def bases_kept() -> Iterator[None]:
    """Inside, `basis_of` gives the same basis for the same windows and frequencies.

    Example
    -------
    >>> plan, omega = WindowPlan(100, 2), np.array([0.1, 0.2])
    >>> with bases_kept():
    ...     basis_of(plan, omega, "mean") is basis_of(plan, omega, "mean")
    True
    >>> basis_of(plan, omega, "mean") is basis_of(plan, omega, "mean")
    False
    """
    if _KEPT.get() is not None:
        yield
        return
    kept: dict[str, _Shelf] = {}
    token = _KEPT.set(kept)
    try:
        yield
    finally:
        _KEPT.reset(token)
        kept.clear()  # contexts that were copied inside hold it still


def basis_of(plan: WindowPlan, omega: NDArray[np.float64], detrend: str) -> FoldedBasis:
    """Tapered sinusoids of a window at `omega`, rad per sample, increasing."""
    return kept(
        lambda: (plan, omega.tobytes(), detrend),
        lambda: FoldedBasis.of(plan, omega, detrend),
        lambda made: made.n_bytes,
    )


def kept(
    key: Callable[[], Hashable],
    make: Callable[[], Made],
    n_bytes: Callable[[Made], int],
    shelf: str = "bases",
) -> Made:
    """What `make` makes, or has made inside `bases_kept` for this key.

    Parameters
    ----------
    key, make : callable
        The key holds all that is made depends on.
    n_bytes : callable
        Memory of what is made; what would fill the whole shelf is not kept.
    shelf : str
        What fills one shelf pushes nothing off another.

    Example
    -------
    >>> with bases_kept():
    ...     [kept(lambda: "key", lambda: made, lambda made: size)
    ...      for made, size in ((1, MOST_BYTES + 1), (2, 8), (3, 8))]
    [1, 2, 2]
    """
    shelves = _KEPT.get()
    if shelves is None:
        return make()
    held, place = shelves.setdefault(shelf, _Shelf()), key()
    if place in held.held:
        return cast("Made", held.held[place])
    made = make()
    size = n_bytes(made)
    if size <= MOST_BYTES:
        if size + held.n_bytes > MOST_BYTES:
            held.clear()
        held.held[place] = made
        held.n_bytes += size
    return made
