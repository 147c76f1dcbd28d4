"""Bases of windows that one piece of work asks for again and again, made once for all of it.

A fit of responses that takes out what windows add asks for the bases of the same windows at the
same frequencies at each of its searches, under each hold, and for its errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
from numpy.typing import NDArray

from flightid.responses.windows.transform import FoldedBasis, WindowPlan

MOST_BYTES = 1 << 26
"""Of bases that are kept: those of five windows at a hundred frequencies take less."""
Key = tuple[WindowPlan, bytes, str]
_KEPT: ContextVar[dict[Key, FoldedBasis] | None] = ContextVar("kept_bases", default=None)


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
    kept: dict[Key, FoldedBasis] = {}
    token = _KEPT.set(kept)
    try:
        yield
    finally:
        _KEPT.reset(token)
        kept.clear()  # contexts that were copied inside hold it still


def basis_of(plan: WindowPlan, omega: NDArray[np.float64], detrend: str) -> FoldedBasis:
    """Tapered sinusoids of a window at `omega`, rad per sample, increasing."""
    kept = _KEPT.get()
    if kept is None:
        return FoldedBasis.of(plan, omega, detrend)
    key = plan, omega.tobytes(), detrend
    if key not in kept:
        made = FoldedBasis.of(plan, omega, detrend)
        if made.n_bytes + sum(each.n_bytes for each in kept.values()) > MOST_BYTES:
            kept.clear()
        kept[key] = made
    return kept[key]
