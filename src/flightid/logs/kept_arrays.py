"""Columns of a log that were read last, so that who asks again does not read the file again."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

MOST_BYTES = 64 << 20
"""Of all columns that one log keeps, whatever its size."""


class KeptArrays:
    """Read-only columns by key, the one not asked for the longest forgotten first.

    Parameters
    ----------
    most_bytes : int
        What all of them may take.

    Example
    -------
    >>> kept = KeptArrays(most_bytes=16)
    >>> _ = kept.put("a", np.zeros(1)), kept.put("b", np.ones(1)), kept.get("a")
    >>> _ = kept.put("c", np.zeros(1))
    >>> kept.get("a") is None, kept.get("b") is None
    (False, True)
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most, self._bytes = most_bytes, 0
        self._arrays: OrderedDict[Hashable, NDArray[np.float64]] = OrderedDict()

    def get(self, key: Hashable) -> NDArray[np.float64] | None:
        """A column that is kept, or None."""
        found = self._arrays.get(key)
        if found is not None:
            self._arrays.move_to_end(key)
        return found

    def put(self, key: Hashable, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The column, which nobody writes to from now on; kept where there is room for it."""
        values.flags.writeable = False
        if values.nbytes <= self._most and key not in self._arrays:
            self._arrays[key] = values
            self._bytes += values.nbytes
            while self._bytes > self._most:
                _, gone = self._arrays.popitem(last=False)
                self._bytes -= gone.nbytes
        return values
