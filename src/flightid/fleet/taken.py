"""What became of each content that a run took: several names of the same bytes are one log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.fleet.catalogue.schema import FAILED, REFUSED
from flightid.fleet.engine.order import KNOWN, LogOutcome
from flightid.fleet.reasons import RefusalReason, grouped_reasons


class TakenContents:
    """What became of each content: several names of the same bytes are one log."""

    def __init__(self) -> None:
        self.outcomes: dict[str, str] = {}
        self._told: dict[str, Mapping[str, str]] = {}
        self._first: dict[str, str] = {}
        self._copies = Counter[str]()
        self._example = ""

    def add(self, outcome: LogOutcome) -> None:
        """Note an outcome; of copies that one counts which is not merely known."""
        log, name = outcome.log, outcome.order.address.name
        if log in self._first:
            self._copies[log] += 1
            self._example = f"{name} is {self._first[log]}"
        self._first.setdefault(log, name)
        if self.outcomes.get(log, KNOWN) == KNOWN:
            self.outcomes[log] = outcome.outcome
            if outcome.outcome in (REFUSED, FAILED):
                names = ("outcome", "reason", "message", "action")
                told = {key: str(getattr(outcome, key)) for key in names}
                self._told[log] = told | {"address": outcome.order.address.address}

    def reasons(self) -> tuple[RefusalReason, ...]:
        """Why some gave no model."""
        return grouped_reasons(self._told.values())

    def counts(self) -> dict[str, int]:
        """Logs by outcome, each content once; by every name those that the catalogue had."""
        found = Counter(self.outcomes.values())
        found[KNOWN] += sum(n for log, n in self._copies.items() if self.outcomes[log] == KNOWN)
        return dict(found)

    def findings(self) -> Iterator[Finding]:
        """That some were taken under several names."""
        fresh = sum(n for log, n in self._copies.items() if self.outcomes[log] != KNOWN)
        if fresh:
            text = f"{counted(fresh, 'log')} with the bytes of another: each content counts once"
            action = "remove copies: their record has vehicle and date by one of the names"
            yield Finding("copied-logs", Light.AMBER, f"{text} ({self._example})", action)
