"""History: what was done to a record, appended by the operation itself after it succeeded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from flightid.table import Cell

FROM_LOG = "Log.record"
"""Operation that heads the history of a log's record."""


@dataclass(frozen=True)
class Step:
    """One operation in the life of a record.

    Attributes
    ----------
    operation : str
        Public name of the operation, for example ``"conditioning.detrend"``.
    options : mapping of str to str, float, int, bool or None
        Options with their units in the names.
    version : str
        Version of flightid that did it.

    Example
    -------
    >>> print(Step("conditioning.detrend", {"order": 1}, "0.1.0"))
    conditioning.detrend(order=1) [flightid 0.1.0]
    """

    operation: str
    options: Mapping[str, Cell] = field(default_factory=dict)
    version: str = ""

    def __str__(self) -> str:
        """Call with options and version on one line."""
        options = ", ".join(f"{key}={value!r}" for key, value in self.options.items())
        return f"{self.operation}({options}) [flightid {self.version}]"


def is_of_log(histories: Iterable[Iterable[Step]]) -> bool:
    """Whether any of the data come from an autopilot's log."""
    return any(step.operation == FROM_LOG for history in histories for step in history)
