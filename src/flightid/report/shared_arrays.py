"""Samples of a page's pictures, each array stored once: frequencies, times, repeated curves.

An array is stored as the differences of its bit patterns, its bytes by their rank: what neighbours
have in common then stands together, and the packing finds it. `page.js` takes them apart again.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

PATTERNS = {1: "<u1", 2: "<u2", 4: "<u4"}
"""Unsigned numbers of the bytes of a sample; wider ones stay where they are."""
SHORTEST = 64
"""Letters of an array below which a reference saves nothing."""


class SharedArrays:
    """Arrays of pictures, by what they hold.

    Example
    -------
    >>> shared = SharedArrays()
    >>> spec = {"dtype": "f4", "bdata": base64.b64encode(bytes(80)).decode()}
    >>> shared.referred([spec, spec]), len(shared.stored())
    ([{'dtype': 'f4', 'stored': [0, 80]}, {'dtype': 'f4', 'stored': [0, 80]}], 80)
    """

    def __init__(self) -> None:
        self._places: dict[tuple[str, str], list[int]] = {}
        self._stored = bytearray()

    def referred(self, node: Any) -> Any:  # noqa: ANN401 — any JSON value
        """The same values with ``stored``, first byte and length, in place of samples."""
        if isinstance(node, list):
            return [self.referred(item) for item in node]
        if not isinstance(node, dict):
            return node
        if (
            len(node.get("bdata", "")) < SHORTEST
            or np.dtype(node["dtype"]).itemsize not in PATTERNS
        ):
            return {key: self.referred(value) for key, value in node.items()}
        key = (node["dtype"], node["bdata"])
        if key not in self._places:
            self._places[key] = self._store(*key)
        return {name: v for name, v in node.items() if name != "bdata"} | {
            "stored": self._places[key]
        }

    def stored(self) -> bytes:
        """All arrays, one after the other."""
        return bytes(self._stored)

    def _store(self, dtype: str, text: str) -> list[int]:
        width = np.dtype(dtype).itemsize
        patterns = np.frombuffer(base64.b64decode(text), PATTERNS[width])
        steps = np.diff(patterns, prepend=patterns.dtype.type(0))
        place = [len(self._stored), steps.nbytes]
        self._stored += steps.view(np.uint8).reshape(-1, width).T.tobytes()
        return place
