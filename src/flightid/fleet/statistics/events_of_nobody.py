"""Events of vehicles of which no flight counts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Set

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.fleet.statistics.events import FleetEvent


def events_of_nobody(events: Iterable[FleetEvent], vehicles: Set[str]) -> Iterator[Finding]:
    """Events of vehicles of which no flight counts: a mistyped name explains nothing."""
    for event in events:
        strange = sorted(set(event.vehicles) - vehicles)
        if strange:
            said = (
                f"event “{event.what}” is of {', '.join(strange)}, of which no flight with a model "
            )
            yield Finding(
                "event-of-nobody",
                Light.AMBER,
                f"{said}is known",
                "write the vehicle as its flights name it",
            )
