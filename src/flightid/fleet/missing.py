"""Which logs of a fleet no record stands for: by address, size and stamp, without reading any."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

from flightid.fleet.addresses import LogAddress
from flightid.fleet.catalogue.compaction import read_columns, rewrite, text_of
from flightid.fleet.catalogue.loose import BROKEN, loose_logs, loose_name, read_loose
from flightid.fleet.catalogue.parts import KnownLogs, read_parts
from flightid.fleet.catalogue.schema import FAILED
from flightid.fleet.catalogue.store import Store
from flightid.fleet.identity import FleetTables
from flightid.frozen import dataclass


@dataclass(frozen=True)
class LogEntry:
    """What tells whether a record still stands for its log.

    Attributes
    ----------
    log, address, stamp, bytes, outcome, reason, id, told : str
        Columns of the table of logs, numbers as text; empty for null.
    """

    log: str
    address: str
    stamp: str
    bytes: str
    outcome: str
    reason: str
    id: str
    told: str


def missing_logs(
    store: Store, addresses: list[LogAddress], tables: FleetTables, *, retry: bool
) -> tuple[list[LogAddress], dict[str, set[str]]]:
    """Logs that no record stands for, by address, size and stamp alone: nothing is read for it.

    Beside them the records that stand at each address for what lay there before. Records of which
    the tables of vehicles and flights say something else by now are forgotten, and so are broken
    ones, those that another of the same address has replaced and, where that is asked, those that
    failed.
    """
    there = {each.address: each for each in addresses}
    done, again, earlier = set[str](), set[str](), dict[str, set[str]]()
    for entry in catalogue_entries(store):
        is_stale = entry.told != tables.told(entry.id or None, entry.address)
        if entry.reason == BROKEN or is_stale or (retry and entry.outcome == FAILED):
            again.add(entry.log)
        elif entry.address in there:
            if stands_for(entry, there[entry.address]):
                done.add(entry.address)
            else:
                earlier.setdefault(entry.address, set()).add(entry.log)
    for address in done:
        again |= earlier.pop(address, set())
    forget(store, again)
    return [each for each in addresses if each.address not in done], earlier


def stands_for(entry: LogEntry, address: LogAddress) -> bool:
    """Whether a log is still the one that was taken; stores of objects tell that by the stamp."""
    is_as_long = address.local is None or entry.bytes == str(address.n_bytes)
    return entry.stamp == address.stamp and is_as_long


def catalogue_entries(store: Store) -> Iterator[LogEntry]:
    """Of every record."""
    names = [each.name for each in fields(LogEntry)]
    parts, _ = read_parts(store)
    if parts:
        yield from (LogEntry(*row) for row in read_columns(store, parts, "logs", names))
    for record in read_loose(store, loose_logs(store)):
        entry = record.rows["logs"][0]
        yield LogEntry(*map(text_of, (entry.get(name) for name in names)))


def forget(store: Store, logs: set[str]) -> None:
    """Take logs out of the catalogue."""
    for log in logs:
        store.remove(loose_name(log))
    if not logs:
        return
    for part in read_parts(store)[0]:
        known = KnownLogs(store, [part])
        if any(map(known.in_parts, logs)):
            rewrite(store, [part], frozenset(logs))
