"""Work in a process that tells how far it is, and ends where it is asked to: both by a small file.

A process that is killed loses what it holds open. One that ends at its next step of progress keeps
that; who asked may still kill it where no such step comes.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from flightid.app.work import answered
from flightid.frozen import dataclass
from flightid.progress import shown_by

EVERY_S = 0.2
"""Between two words of a process."""
MOST_BYTES = 1 << 12
ENDED = "ended on request"


@dataclass(frozen=True)
class WorkProgress:
    """How far work is.

    Attributes
    ----------
    label : str
        What is done.
    share : float or None
        How much of that; None where nobody knows.
    """

    label: str
    share: float | None


class Cancellation(BaseException):
    """Work was asked to end: nothing that handles errors of the work holds it up."""


def watched(place: Path, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
    """Work as `answered` does it, with its progress in a file.

    Parameters
    ----------
    place : Path
        Where progress stands; `ask_to_end` of the same ends the work.
    call : callable
    *inputs
        Of the call.
    """
    begun = time.perf_counter()
    teller = _Teller(place)
    try:
        with shown_by(teller.opened):
            return answered(call, *inputs)
    except Cancellation:
        return None, ENDED, time.perf_counter() - begun


def progress_at(place: Path) -> WorkProgress | None:
    """What stands in a file of progress; None where there is nothing that can be read."""
    try:
        found = json.loads(place.read_bytes()[:MOST_BYTES])
        share = found["share"]
        return WorkProgress(str(found["label"]), None if share is None else float(share))
    except (OSError, ValueError, TypeError, LookupError):
        return None


def ask_to_end(place: Path) -> None:
    """Ask for the end of work; it comes with the next step of its progress."""
    with suppress(OSError):
        _request(place).touch()


def forget(place: Path) -> None:
    """Remove the file of work that has ended, and the request."""
    for path in (place, _request(place)):
        with suppress(OSError):
            path.unlink(missing_ok=True)


def _request(place: Path) -> Path:
    return place.with_suffix(".end")


class _Teller:
    """Writes down the newest of the meters that are open."""

    def __init__(self, place: Path) -> None:
        self._place, self._last = place, 0.0
        self._open: list[_Meter] = []

    def opened(self, label: str, total: int | None) -> _Meter:
        """A meter for a piece of work, told at once."""
        meter = _Meter(self, label, total)
        self._open.append(meter)
        self.tell(at_once=True)
        return meter

    def closed(self, meter: _Meter) -> None:
        self._open = [each for each in self._open if each is not meter]

    def tell(self, *, at_once: bool = False) -> None:
        now = time.monotonic()
        if not self._open or not (at_once or now - self._last >= EVERY_S):
            return
        self._last = now
        if _request(self._place).exists():
            raise Cancellation
        newest = self._open[-1]
        with suppress(OSError):
            # Read by who bears half a file: nothing is lost with it.
            said = json.dumps({"label": newest.label, "share": newest.share})
            self._place.write_text(said, encoding="utf-8")


class _Meter:
    """One piece of work."""

    def __init__(self, teller: _Teller, label: str, total: int | None) -> None:
        self._teller, self.label = teller, label
        self._total, self._done = total, 0

    @property
    def share(self) -> float | None:
        return min(1.0, self._done / self._total) if self._total else None

    def advance(self, steps: int = 1) -> None:
        """Count steps that are done."""
        self._done += steps
        self._teller.tell()

    def close(self) -> None:
        """End the work, finished or not."""
        self._teller.closed(self)
