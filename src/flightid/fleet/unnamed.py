"""Logs that name no vehicle, and events of vehicles without a log: they count in no answer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from typing import Any

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.fleet.catalogue.schema import FITTED
from flightid.fleet.statistics.events import FleetEvent

ACTION = "name vehicles by folder, name or parameter in [vehicles], or in a table of it"


def unnamed_logs(rows: Iterable[Mapping[str, Any]]) -> int:
    """Rows of the table of logs that have a model and no vehicle."""
    return sum(each["outcome"] == FITTED and each["vehicle"] is None for each in rows)


def unnamed_light(unnamed: int) -> Finding | None:
    """What that means; None where every log with a model names its vehicle."""
    if not unnamed:
        return None
    verb = "counts" if unnamed == 1 else "count"
    said = f"{counted(unnamed, 'log')} with a model {verb} nowhere: nothing says of which vehicle"
    return Finding("no-vehicle", Light.AMBER, said, ACTION)


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
