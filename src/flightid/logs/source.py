"""What a log format must answer: the protocol behind `Log`, and the small nouns it speaks in."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.findings import Finding
from flightid.frozen import dataclass


@dataclass(frozen=True)
class MessageInfo:
    """What a log holds of one message type (ArduPilot message, PX4 topic).

    Attributes
    ----------
    name : str
        Name, for example ``"RATE"`` or ``"vehicle_attitude"``.
    count : int
        Rows, all instances together.
    instances : tuple of int
        Instance numbers; empty where the message has no instances.
    fields : mapping of str to str
        Unit of the scaled numbers by field name; ``"1"`` where there is none or none is declared.
    text_fields : tuple of str
        Those fields that hold text.
    rate_hz : float or None
        Rows per second of one instance from the median interval; None below two stamped rows.
    first_s, last_s : float or None
        First and last stamp on the autopilot's clock, s; None without stamps.

    Example
    -------
    >>> MessageInfo("RATE", 2, (), {"TimeUS": "s", "R": "deg/s"}, (), 400.0, 1.0, 1.0025)
    MessageInfo('RATE', 2 rows, 2 fields, 400 Hz)
    """

    name: str
    count: int
    instances: tuple[int, ...] = ()
    fields: Mapping[str, str] = field(default_factory=dict)
    text_fields: tuple[str, ...] = ()
    rate_hz: float | None = None
    first_s: float | None = None
    last_s: float | None = None

    @classmethod
    def of_stamps(
        cls,
        name: str,
        count: int,
        instances: tuple[int, ...],
        fields: Mapping[str, str],
        text_fields: tuple[str, ...],
        time_s: NDArray[np.float64],
    ) -> MessageInfo:
        """Rate, first and last stamp by the stamps of one instance, shape (n,)."""
        steps = np.diff(time_s)
        middle = float(np.median(steps)) if steps.size else 0.0
        rate_hz = 1.0 / middle if middle > 0 else None
        ends = (float(time_s.min()), float(time_s.max())) if time_s.size else (None, None)
        return cls(name, count, instances, fields, text_fields, rate_hz, *ends)

    def __repr__(self) -> str:
        """Rows, fields and rate on one line."""
        rate = "no rate" if self.rate_hz is None else f"{self.rate_hz:.4g} Hz"
        copies = f", {len(self.instances)} instances" if len(self.instances) > 1 else ""
        return (
            f"MessageInfo({self.name!r}, {self.count} rows, {len(self.fields)} fields{copies}, "
            f"{rate})"
        )


@dataclass(frozen=True)
class Event:
    """Something that happened: a mode change, an error, an arming, a text message.

    Attributes
    ----------
    time_s : float or None
        Stamp on the autopilot's clock, s; None where the format gives none.
    kind : str
        ``"mode"``, ``"error"``, ``"event"``, ``"arming"`` or ``"text"``.
    text : str
        The event in words.

    Example
    -------
    >>> print(Event(12.5, "mode", "SYSTEMID"))
    12.500 s mode: SYSTEMID
    """

    time_s: float | None
    kind: str
    text: str

    def __str__(self) -> str:
        """Stamp, kind and text on one line."""
        stamp = "no stamp" if self.time_s is None else f"{self.time_s:.3f} s"
        return f"{stamp} {self.kind}: {self.text}"


@dataclass(frozen=True)
class ByteRange:
    """Bytes of a file that were not read as a message, and why.

    Attributes
    ----------
    start, stop : int
        Offsets in the file, `stop` excluded.
    reason : str
        Why they were skipped.

    Example
    -------
    >>> ByteRange(100, 164, "no message header").size
    64
    """

    start: int
    stop: int
    reason: str

    @property
    def size(self) -> int:
        """Number of bytes."""
        return self.stop - self.start


@dataclass(frozen=True)
class Gap:
    """A span without data in a log that goes on afterwards.

    Attributes
    ----------
    start_s, stop_s : float
        Last stamp before and first stamp after, s.
    reason : str
        What is known of the cause.

    Example
    -------
    >>> round(Gap(10.0, 10.4, "logger dropout").duration_s, 3)
    0.4
    """

    start_s: float
    stop_s: float
    reason: str

    @property
    def duration_s(self) -> float:
        """Length, s."""
        return self.stop_s - self.start_s


@dataclass(frozen=True)
class ParameterChange:
    """A parameter that took another value while the log ran.

    Attributes
    ----------
    time_s : float or None
        Stamp of the change, s; None where the format gives none.
    name : str
        Parameter.
    old, new : float
        Value before and after.

    Example
    -------
    >>> ParameterChange(3.0, "ATC_RAT_RLL_P", 0.135, 0.15).new
    0.15
    """

    time_s: float | None
    name: str
    old: float
    new: float


def changes_among(rows: Iterable[tuple[float | None, str, float]]) -> list[ParameterChange]:
    """Values that differ from the one logged before: of rows of stamp, name and value.

    Example
    -------
    >>> [each.new for each in changes_among([(0.0, "P", 0.1), (1.0, "P", 0.1), (2.0, "P", 0.2)])]
    [0.2]
    """
    last: dict[str, float] = {}
    changes = []
    for time_s, name, value in rows:
        if last.get(name, value) != value:
            changes.append(ParameterChange(time_s, name, last[name], value))
        last[name] = value
    return changes


BOARD = re.compile(r"\b([0-9A-F]{8} [0-9A-F]{8} [0-9A-F]{8})$")


def board_of(texts: Iterable[str]) -> str:
    """The unique number of the processor, as ArduPilot says it at the start of a flight.

    Example
    -------
    >>> board_of(["ArduCopter V4.5.1", "CubeOrange 0034003B 34385106 36373936"])
    '0034003B 34385106 36373936'
    """
    return next((found.group(1) for text in texts if (found := BOARD.search(text))), "")


class LogSource(Protocol):
    """A log file of one format, opened. `Log` adds everything that formats have in common.

    Names are those of the autopilot. Numbers come scaled: raw times multiplier, in the unit that
    `MessageInfo.fields` gives. `instance` None means all rows, in file order.
    """

    @property
    def kind(self) -> str:
        """By whom: ``"ardupilot"``, ``"px4"``, ``"betaflight"``, ``"inav"``, ``"mavlink"``."""

    @property
    def vehicle(self) -> str | None:
        """``"copter"``, ``"plane"``, …; None where the log does not tell."""

    @property
    def firmware(self) -> str:
        """Firmware and version as logged; empty where the log does not tell."""

    @property
    def board(self) -> str:
        """Unique number of the autopilot's processor; empty where the log does not tell."""

    @property
    def messages(self) -> Mapping[str, MessageInfo]:
        """Message types that have at least one row, by name."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Final value by parameter name."""

    @property
    def parameter_changes(self) -> Sequence[ParameterChange]:
        """Changes after the first value, in file order."""

    @property
    def events(self) -> Sequence[Event]:
        """Modes, errors, texts, in file order."""

    @property
    def skipped(self) -> Sequence[ByteRange]:
        """Every byte range that was not read as a message."""

    @property
    def gaps(self) -> Sequence[Gap]:
        """Spans without data."""

    @property
    def findings(self) -> Sequence[Finding]:
        """What the reader noticed."""

    def fields(self, message: str) -> tuple[Mapping[str, str], tuple[str, ...]]:
        """Unit by field name, and which fields hold text, as in `MessageInfo`."""

    def rows(self, message: str, instance: int | None) -> int:
        """Rows of a message, or of one of its instances."""

    def numbers(self, message: str, field: str, instance: int | None) -> NDArray[np.float64]:
        """Scaled numbers, shape (n_rows,) or (n_rows, n_elements) for an array field."""

    def columns(
        self, message: str, fields: Sequence[str], instance: int | None
    ) -> list[NDArray[np.float64]]:
        """Scaled numbers of several fields, as by `numbers`, in one pass over the rows."""

    def texts(self, message: str, field: str, instance: int | None) -> list[str]:
        """Texts of a field that holds text, one a row."""

    def time_s(self, message: str, instance: int | None) -> NDArray[np.float64]:
        """Stamps on the autopilot's clock, s, shape (n_rows,), as logged (not sorted)."""
