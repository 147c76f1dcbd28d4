"""A log of tables that a test writes down, for what looks at few of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np


class _Table:
    """Stamps and columns, as a log's tables have them."""

    def __init__(self, time_s: Sequence[float] | np.ndarray, columns: Mapping[str, object]) -> None:
        self.time_s = np.asarray(time_s, dtype=np.float64)
        self._columns = {name: np.asarray(values) for name, values in columns.items()}

    def __getitem__(self, name: str) -> np.ndarray:
        return self._columns[name]


class HandmadeLog:
    """Its `log` answers as one that was read: kind, vehicle, messages and tables."""

    def __init__(self, kind: str, vehicle: str = "copter", **more: object) -> None:
        self._tables: dict[str, _Table] = {}
        self.kind, self.vehicle = kind, vehicle
        self.messages: dict[str, Any] = {}
        self.parameters: dict[str, float] = {}
        self.gaps: tuple[object, ...] = ()
        self.duration_s: float | None = None
        self.__dict__.update(more)

    @property
    def log(self) -> Any:
        """Itself, as whatever is asked for a log takes it."""
        return self

    def with_table(
        self, name: str, time_s: Sequence[float] | np.ndarray, **columns: object
    ) -> HandmadeLog:
        """The same with a message of these columns."""
        self._tables[name] = _Table(time_s, columns)
        self.messages[name] = SimpleNamespace(fields=tuple(columns), instances=(), name=name)
        if self.kind == "px4":
            self.messages[name].instances = (0,)
        return self

    def __contains__(self, name: str) -> bool:
        return name in self._tables

    def table(self, name: str, _: int | None = None) -> _Table:
        """That message's."""
        return self._tables[name]
