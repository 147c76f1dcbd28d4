"""Which logs of a fleet no record stands for: by address, size and stamp, without reading any."""

from __future__ import annotations

from collections.abc import Iterator, Set
from dataclasses import fields

from flightid.fleet.addresses import LogAddress
from flightid.fleet.catalogue.compaction import read_columns, rewrite, text_of
from flightid.fleet.catalogue.loose import BROKEN, loose_logs, loose_name, read_loose
from flightid.fleet.catalogue.parts import KnownLogs, read_parts
from flightid.fleet.catalogue.schema import FAILED, FITTED
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
    vehicle, type, flown_at, flown_at_from : str
        What it counts as.
    """

    log: str
    address: str
    stamp: str
    bytes: str
    outcome: str
    reason: str
    id: str
    told: str
    vehicle: str
    type: str
    flown_at: str
    flown_at_from: str

    def is_outdated(self, tables: FleetTables) -> bool:
        """Whether the tables of the fleet say something else of it by now."""
        return self.told != tables.told(self.id or None, self.address)


@dataclass(frozen=True)
class MissingLogs:
    """What a run finds of a catalogue, in one pass over its records.

    Attributes
    ----------
    addresses : list of LogAddress
        Logs that no record stands for.
    earlier : dict of str to set of str
        By address: records of what lay there before.
    gone : dict of str to LogEntry
        By log: records whose file is not at the places of the fleet file.
    fitted : dict of str to str
        By log: vehicle of those with a model; empty where it names none.
    held : dict of str to LogEntry
        By log: records that are kept, wherever their file lies.
    """

    addresses: list[LogAddress]
    earlier: dict[str, set[str]]
    gone: dict[str, LogEntry]
    fitted: dict[str, str]
    held: dict[str, LogEntry]


def missing_logs(
    store: Store, addresses: list[LogAddress], tables: FleetTables, *, retry: bool
) -> MissingLogs:
    """Logs that no record stands for, by address, size and stamp alone: nothing is read for it.

    Records of which the tables of vehicles and flights say something else by now are forgotten,
    and so are broken ones, those that another of the same address has replaced and, where that is
    asked, those that failed.
    """
    there = {each.address: each for each in addresses}
    done, again, earlier = set[str](), set[str](), dict[str, set[str]]()
    gone, fitted, held = dict[str, LogEntry](), dict[str, str](), dict[str, LogEntry]()
    for entry in catalogue_entries(store):
        is_failed = retry and entry.outcome == FAILED
        if entry.reason == BROKEN or entry.is_outdated(tables) or is_failed:
            again.add(entry.log)
            continue
        held[entry.log] = entry
        if entry.outcome == FITTED:
            fitted[entry.log] = entry.vehicle
        if entry.address not in there:
            gone[entry.log] = entry
        elif stands_for(entry, there[entry.address]):
            done.add(entry.address)
        else:
            earlier.setdefault(entry.address, set()).add(entry.log)
    for address in done:
        again |= earlier.pop(address, set())
    forget(store, again)
    left = [each for each in addresses if each.address not in done]
    fitted = {k: v for k, v in fitted.items() if k not in again}
    held = {k: v for k, v in held.items() if k not in again}
    return MissingLogs(left, earlier, gone, fitted, held)


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
    out_of_parts(store, logs)


def out_of_parts(store: Store, logs: Set[str]) -> None:
    """Write the parts anew that hold some of these logs, without them."""
    if not logs:
        return
    for part in read_parts(store)[0]:
        known = KnownLogs(store, [part])
        if any(map(known.in_parts, logs)):
            rewrite(store, [part], frozenset(logs))
