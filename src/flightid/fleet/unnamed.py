"""Logs with a model that name no vehicle: they are in the catalogue, and count in no answer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.findings import Finding, counted
from flightid.fleet.catalogue.compaction import read_columns
from flightid.fleet.catalogue.loose import loose_logs, read_loose
from flightid.fleet.catalogue.parts import KnownLogs, read_parts
from flightid.fleet.catalogue.schema import FITTED
from flightid.fleet.catalogue.store import Store

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


def named_logs(store: Store) -> Iterator[Mapping[str, Any]]:
    """Outcome and vehicle of every log; of compacted ones where the extra is installed."""
    parts, _ = read_parts(store)
    try:
        for outcome, vehicle in read_columns(store, parts, "logs", ("outcome", "vehicle")):
            yield {"outcome": outcome, "vehicle": vehicle}
    except OptionError:
        pass
    known = KnownLogs(store, parts)
    loose = [log for log in loose_logs(store) if not known.in_parts(log)]
    for record in read_loose(store, loose):
        yield record.rows["logs"][0]
