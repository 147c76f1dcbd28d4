"""History: what was done to a record, appended by the operation itself after it succeeded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field

from flightid.frozen import dataclass
from flightid.table import Cell

FROM_LOG = "Log.record"
"""Operation that heads the history of a log's record."""
FLOWN = "simulation.fly"
"""The same of a simulated flight's record, whose rows are those of its log."""
NEW_BASES = ("conditioning.to_uniform", "conditioning.resample")
SPREADS = ("low-pass", "band-limited", JITTERED := "previous value of stamps that jitter")
"""What these do to a channel that puts what is later into a sample."""


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


def spread_channels(histories: Iterable[Iterable[Step]], names: Iterable[str]) -> tuple[str, ...]:
    """Channels among these whose samples were made of earlier and later ones.

    Logs are passed over: an autopilot closes a loop around what it logs.

    Example
    -------
    >>> moved = Step("conditioning.resample", {"q": "low-pass 22.5 Hz, zero phase"})
    >>> spread_channels([[moved]], ["u", "q"])
    ('q',)
    """
    steps = [
        step for history in map(list, histories) if not is_of_log([history]) for step in history
    ]
    said = [step.options for step in steps if step.operation in NEW_BASES]
    return tuple(n for n in names if any(str(each.get(n, "")).startswith(SPREADS) for each in said))
