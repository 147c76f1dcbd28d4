"""Where each file of a fleet stands: taken, a copy of one that is, or not taken yet."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.fleet.addresses import LogAddress, find_logs
from flightid.fleet.catalogue.loose import BROKEN
from flightid.fleet.catalogue.store import Store
from flightid.fleet.identity import FleetTables, read_tables
from flightid.fleet.missing import LogEntry, catalogue_entries, stands_for
from flightid.fleet.reasons import WIDTH
from flightid.fleet.recorded import recorded_logs
from flightid.fleet.renamed import RenamedLog, outdated_light
from flightid.fleet.settings import FleetSettings, VehicleRules
from flightid.fleet.taken import copies_named
from flightid.frozen import dataclass
from flightid.wrapping import wrapped


@dataclass(frozen=True)
class FleetShares:
    """Files at the places of a fleet, each counted once.

    Attributes
    ----------
    outcomes : mapping of str to int
        Files whose record is in the catalogue, by outcome.
    copies : mapping of str to str
        Files with the bytes of one of these, and its address.
    waiting : tuple of str
        Files that the next run takes.
    gone : tuple of str
        Addresses of records whose file is no longer there.
    renamed : tuple of RenamedLog
        Files that have another name, or another vehicle, than their records until the next run.
    altered : tuple of str
        Addresses of records whose file has other bytes by now, as one that was cut.
    """

    outcomes: Mapping[str, int]
    copies: Mapping[str, str]
    waiting: tuple[str, ...]
    gone: tuple[str, ...]
    renamed: tuple[RenamedLog, ...] = ()
    altered: tuple[str, ...] = ()

    @property
    def unheld(self) -> tuple[str, ...]:
        """Addresses of records of which no file has the bytes any more."""
        return (*self.gone, *self.altered)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What of the catalogue is not as the files are."""
        return outdated_light(self.renamed, len(self.gone), len(self.altered))

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    @classmethod
    def of(
        cls,
        store: Store,
        addresses: Sequence[LogAddress],
        rules: VehicleRules,
        tables: FleetTables,
    ) -> FleetShares | None:
        """Of a catalogue; None without the library that reads its parts.

        A file without a record is read where one of its size has one, for it may be a copy.
        """
        try:
            entries = {each.log: each for each in catalogue_entries(store)}
        except OptionError:
            return None
        there = {each.address: each for each in addresses}
        own = {e.address: e for e in entries.values() if _is_there(e, there)}
        copies, waiting = dict[str, str](), list[str]()
        of = {entry.log: entry.address for entry in own.values()}
        outdated = [e for e in own.values() if e.reason != BROKEN and e.is_outdated(tables)]
        renamed = [RenamedLog.of(e, there[e.address], rules, tables) for e in outdated]
        renamed = [each for each in renamed if each.other_vehicle]
        left = [each for each in addresses if each.address not in own]
        seen = recorded_logs(left, entries)
        # A file that was touched alone keeps its record before a copy of it is asked.
        for each in sorted(
            left, key=lambda e: _lay_at(entries, seen.get(e.address, "")) != e.address
        ):
            log = seen.get(each.address, "")
            if log in of:
                copies[each.address] = of[log]
            elif log in entries:  # Its record stands for it, under the new name where it has one.
                own[each.address], of[log] = entries[log], each.address
                named = RenamedLog.of(entries[log], each, rules, tables)
                renamed += [named] if named.differs else []
            else:
                waiting.append(each.address)
        counts = Counter(entry.outcome for entry in own.values())
        lost = sorted(e.address for log, e in entries.items() if log not in of)
        gone = tuple(each for each in lost if each not in there)
        altered = tuple(each for each in lost if each in there)
        kept = dict(sorted(copies.items()))
        return cls(dict(counts), kept, tuple(waiting), gone, tuple(renamed), altered)


def fleet_shares(settings: FleetSettings, store: Store) -> tuple[FleetShares | None, int]:
    """Where each file of a fleet file stands in a catalogue, and how many there are."""
    found = find_logs([settings.place(each) for each in settings.words.logs])
    tables = read_tables(settings)
    return FleetShares.of(store, found, settings.vehicles, tables), len(found)


def _lay_at(entries: Mapping[str, LogEntry], log: str) -> str:
    """Address of the record of a log; empty without one."""
    return entries[log].address if log in entries else ""


def _is_there(entry: LogEntry, there: Mapping[str, LogAddress]) -> bool:
    """Whether the file of a record lies where it lay; a broken record keeps no more than that."""
    found = there.get(entry.address)
    return found is not None and (entry.reason == BROKEN or stands_for(entry, found))


def copy_lines(shares: FleetShares | None) -> list[str]:
    """Lines of a terminal that name copies: each with what it is a copy of."""
    if shares is None or not shares.copies:
        return []
    number = len(shares.copies)
    said = f"{number} cop{'y' if number == 1 else 'ies'}: {copies_named(shares.copies)}"
    return wrapped(said, WIDTH, first="  ", later="      ")
