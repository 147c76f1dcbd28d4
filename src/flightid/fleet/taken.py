"""What became of each content that a run took: several names of the same bytes are one log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.fleet.addresses import LogAddress
from flightid.fleet.catalogue.schema import FAILED, FITTED, REFUSED
from flightid.fleet.engine.order import KNOWN, LogOutcome
from flightid.fleet.reasons import RefusalReason, grouped_reasons

MOST_NAMED = 5
"""Copies that are named in a line; the status of a fleet has all."""


class TakenContents:
    """What became of each content: several names of the same bytes are one log.

    Attributes
    ----------
    outcomes : dict of str to str
        By log.
    known : dict of str to list of LogAddress
        Logs that the catalogue had, and where they lie, copies too.
    fitted : dict of str to str
        Vehicle of each log that gave a model now; empty where it names none.
    memory_bytes : int or None
        Most that a process had which took one; None where the system does not say.
    """

    def __init__(self) -> None:
        self.outcomes: dict[str, str] = {}
        self.known: dict[str, list[LogAddress]] = {}
        self.fitted: dict[str, str] = {}
        self.memory_bytes: int | None = None
        self._told: dict[str, Mapping[str, str]] = {}
        self._first: dict[str, str] = {}
        self._copied: dict[str, str] = {}

    def add(self, outcome: LogOutcome) -> None:
        """Note an outcome; of copies that one counts which is not merely known."""
        log, address = outcome.log, outcome.order.address.address
        if outcome.memory_bytes is not None:
            self.memory_bytes = max(outcome.memory_bytes, self.memory_bytes or 0)
        if self._first.setdefault(log, address) != address:
            self._copied[address] = log
        if outcome.outcome == KNOWN:
            self.known.setdefault(log, []).append(outcome.order.address)
        elif outcome.outcome == FITTED:
            self.fitted[log] = outcome.vehicle
        if self.outcomes.get(log, KNOWN) == KNOWN:
            self.outcomes[log] = outcome.outcome
            if outcome.outcome in (REFUSED, FAILED):
                names = ("outcome", "reason", "message", "action")
                told = {key: str(getattr(outcome, key)) for key in names}
                self._told[log] = told | {"address": address}

    @property
    def names(self) -> int:
        """Logs that were noted, by every name."""
        return len(self._first) + len(self._copied)

    @property
    def copies(self) -> dict[str, str]:
        """Addresses whose bytes another one had that was taken, and which."""
        fresh = ((copy, log) for copy, log in self._copied.items() if self.outcomes[log] != KNOWN)
        return {copy: self._first[log] for copy, log in sorted(fresh)}

    def reasons(self) -> tuple[RefusalReason, ...]:
        """Why some gave no model."""
        return grouped_reasons(self._told.values())

    def counts(self) -> dict[str, int]:
        """Logs by outcome, each content once; by every name those that the catalogue had."""
        found = Counter(self.outcomes.values())
        found[KNOWN] += sum(self.outcomes[log] == KNOWN for log in self._copied.values())
        return dict(found)

    def findings(self) -> Iterator[Finding]:
        """That some were taken under several names."""
        if copies := self.copies:
            text = f"{counted(len(copies), 'log')} with the bytes of another: each counts once"
            action = "remove copies: their record has vehicle and date by one of the names"
            yield Finding("copied-logs", Light.AMBER, f"{text} ({copies_named(copies)})", action)


def copies_named(copies: Mapping[str, str]) -> str:
    """The first few of some copies, each with what it is a copy of.

    By file name; of equal names by the path below the folder that both lie in.

    Example
    -------
    >>> copies_named({"/logs/b/1.bin": "/logs/a/1.bin", "/logs/3.bin": "/logs/2.bin"})
    'b/1.bin is a/1.bin, 3.bin is 2.bin'
    """
    shown = list(copies.items())[:MOST_NAMED]
    said = [" is ".join(_told_apart(copy, first)) for copy, first in shown]
    left = len(copies) - len(shown)
    return ", ".join(said) + (f" and {left} more" if left else "")


def _told_apart(one: str, other: str) -> tuple[str, str]:
    """Two addresses as short as they can be told apart."""
    first, second = PurePosixPath(one), PurePosixPath(other)
    if first.name != second.name:
        return first.name, second.name
    pairs = zip(first.parts, second.parts, strict=False)
    alike = next((n for n, (a, b) in enumerate(pairs) if a != b), 0)
    return tuple("/".join(each.parts[alike:]) for each in (first, second))  # type: ignore[return-value]  # two
