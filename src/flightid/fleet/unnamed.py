"""Logs with a model that name no vehicle: they are in the catalogue, and count in no answer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.fleet.catalogue.schema import FITTED

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
