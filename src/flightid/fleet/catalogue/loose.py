"""Loose files: one small record a log, the durable form of what has been done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.fleet.catalogue.record import KEY_LENGTH, LogRecord, legible
from flightid.fleet.catalogue.schema import FAILED, TABLES
from flightid.fleet.catalogue.store import Store

LOOSE = "loose"
QUARANTINE = "quarantine"
AGAIN = "flightid fleet run takes the log again"
REWRITE = "move parts/ of the catalogue away and run the fleet again: it takes those logs again"
SUFFIX = ".json"
BROKEN = "record"
"""Kind of a failure: the record of a log could not be read again."""


def loose_name(log: str) -> str:
    """Name of a log's record in the store."""
    return f"{LOOSE}/{log}{SUFFIX}"


def write_loose(store: Store, record: LogRecord) -> None:
    """Write the record of a log whole or not at all, with the instant and the store's name."""
    recipe = store.root.rpartition("/")[2]
    store.write(loose_name(record.log), record.stamped(recipe).to_bytes())


def loose_logs(store: Store) -> list[str]:
    """Digests of the logs that have a loose file, sorted."""
    found = (name.removesuffix(SUFFIX) for name in store.names(LOOSE) if name.endswith(SUFFIX))
    return sorted(log for log in found if _is_digest(log))


def _is_digest(text: str) -> bool:
    return len(text) == KEY_LENGTH and set(text) <= set("0123456789abcdef")


def read_loose(store: Store, logs: Iterable[str]) -> Iterator[LogRecord]:
    """Records of logs; a broken one goes to quarantine, and stands as a failure in its place.

    One that another operator has just compacted is passed over.
    """
    for log in logs:
        try:
            content = store.read(loose_name(log))
        except FileNotFoundError:
            continue
        try:
            record = LogRecord.from_bytes(content)
            if record.log != log:
                raise DataError("the record of another log", found=record.log, needed=log)
        except DataError as error:
            yield _quarantined(store, log, content, error)
            continue
        yield record


def _quarantined(store: Store, log: str, content: bytes, error: DataError) -> LogRecord:
    """Keep the bytes for whoever looks into it, and put a failure in their place."""
    store.write(f"{QUARANTINE}/{log}{SUFFIX}", content)
    known = {name: legible(content, "logs", name) for name in ("vehicle", "address")}
    record = broken_record(log, str(error), **known)
    write_loose(store, record)
    return record


def broken_record(
    log: str, message: str, vehicle: str | None = None, address: str | None = None
) -> LogRecord:
    """The record of a log whose record is broken: a failure, until the log is run again."""
    common: Mapping[str, Any] = {"log": log, "light": str(Light.RED), "vehicle": vehicle}
    entry = {"outcome": FAILED, "reason": BROKEN, "message": message, "models": 0, "action": AGAIN}
    entry["address"] = address
    failure = {"kind": BROKEN, "message": message, "stage": BROKEN}
    every: dict[str, list[dict[str, Any]]] = {"logs": [entry], "failures": [failure]}
    rows = {name: [{**common, **row} for row in every.get(name, ())] for name in TABLES}
    return LogRecord(log, rows)
