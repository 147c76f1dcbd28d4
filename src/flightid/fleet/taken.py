"""What became of each content that a run took: several names of the same bytes are one log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.fleet.catalogue.schema import FAILED, REFUSED
from flightid.fleet.engine.order import KNOWN, LogOutcome
from flightid.fleet.reasons import RefusalReason, grouped_reasons

MOST_NAMED = 5
"""Copies that are named in a line; the status of a fleet has all."""


class TakenContents:
    """What became of each content: several names of the same bytes are one log."""

    def __init__(self) -> None:
        self.outcomes: dict[str, str] = {}
        self._told: dict[str, Mapping[str, str]] = {}
        self._first: dict[str, str] = {}
        self._copied: dict[str, str] = {}

    def add(self, outcome: LogOutcome) -> None:
        """Note an outcome; of copies that one counts which is not merely known."""
        log, address = outcome.log, outcome.order.address.address
        if log in self._first:
            self._copied[address] = log
        self._first.setdefault(log, address)
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
    """The first few of some copies, each with what it is a copy of, by file name."""
    shown = list(copies.items())[:MOST_NAMED]
    said = [f"{PurePosixPath(copy).name} is {PurePosixPath(first).name}" for copy, first in shown]
    left = len(copies) - len(shown)
    return ", ".join(said) + (f" and {left} more" if left else "")
