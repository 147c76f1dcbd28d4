"""Logs whose name or vehicle is another than that of their record: told, and followed unread."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import PurePosixPath

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.fleet.addresses import LogAddress
from flightid.fleet.catalogue.compaction import read_records
from flightid.fleet.catalogue.loose import loose_logs, read_loose, write_loose
from flightid.fleet.catalogue.parts import read_parts
from flightid.fleet.catalogue.record import LogRecord
from flightid.fleet.catalogue.store import Store
from flightid.fleet.identity import FleetTables, LogIdentity, LogWitness, identity_of
from flightid.fleet.missing import LogEntry, out_of_parts
from flightid.fleet.settings import VehicleRules
from flightid.fleet.study_rows import told_covariates
from flightid.frozen import dataclass

MOST_NAMED = 5
"""Logs that are named in a line."""
TABLE = "table"


@dataclass(frozen=True)
class RenamedLog:
    """A log that has another name, or another vehicle, than its record.

    Attributes
    ----------
    before, now : str
        Addresses: of the record, and of the file.
    vehicle_before : str
        Of the record; empty where it names none.
    vehicle_now : str or None
        As the fleet file tells by now; None where the log must be read for it.
    """

    before: str
    now: str
    vehicle_before: str
    vehicle_now: str | None

    @classmethod
    def of(
        cls, entry: LogEntry, address: LogAddress, rules: VehicleRules, tables: FleetTables
    ) -> RenamedLog:
        """A record beside the file that has its bytes."""
        found = renamed_identity(entry, address, rules, tables)
        now = None if found is None else found.vehicle or ""
        return cls(entry.address, address.address, entry.vehicle, now)

    @property
    def other_vehicle(self) -> bool:
        """Whether it counts for another vehicle, or may."""
        return self.vehicle_now != self.vehicle_before

    @property
    def differs(self) -> bool:
        """Whether its name or its vehicle does; of a log that was only touched neither."""
        return self.before != self.now or self.other_vehicle

    @property
    def words(self) -> str:
        """Both names, and both vehicles where they differ."""
        first, second = (PurePosixPath(each) for each in (self.before, self.now))
        moved = first.name == second.name
        names = [str(first), str(second)] if moved else [first.name, second.name]
        said = names[0] if self.before == self.now else f"{names[0]} is {names[1]} now"
        if not self.other_vehicle:
            return said
        new = "its log says" if self.vehicle_now is None else self.vehicle_now or "no vehicle"
        return f"{said} (vehicle {self.vehicle_before or 'none'}, now {new})"


def renamed_identity(
    entry: LogEntry, address: LogAddress, rules: VehicleRules, tables: FleetTables
) -> LogIdentity | None:
    """Who flew a log that lies elsewhere now, by its record and the new place; it is not read.

    Returns
    -------
    LogIdentity or None
        None where only the log itself tells its type or date: a table told them before.
    """
    known = tables.of(entry.id or None, entry.address)[0].get("type") or rules.type
    started = _instant(entry.flown_at) if entry.flown_at_from == "log" else None
    seen = LogWitness(entry.id or None, None if known else entry.type or None, started)
    found = identity_of(seen, address.address, address.changed_s, rules, tables)
    is_dated = entry.flown_at_from != TABLE or found.flown_at_from == TABLE
    return found if is_dated and (found.type is not None or not entry.type) else None


def _instant(text: str) -> datetime.datetime | None:
    return datetime.datetime.fromisoformat(text) if text else None


def follow(store: Store, moved: Mapping[str, tuple[LogAddress, LogIdentity | None]]) -> None:
    """Give records the place, vehicle, type and date that their logs have now.

    Without an identity only size and time of change are new: the file was touched. The new record
    is written before the old one goes: a part that holds it counts until then.
    """
    parts, _ = read_parts(store)
    held = list(read_records(store, parts, moved.keys())) if parts and moved else []
    compacted = {record.log for record in held}
    loose = [log for log in loose_logs(store) if log in moved and log not in compacted]
    for record in (*held, *read_loose(store, loose)):
        write_loose(store, _followed(record, *moved[record.log]))
    out_of_parts(store, compacted)


def _followed(record: LogRecord, address: LogAddress, identity: LogIdentity | None) -> LogRecord:
    lies = {"address": address.address, "bytes": address.n_bytes, "stamp": address.stamp}
    if identity is None:
        return LogRecord(record.log, {**record.rows, "logs": [{**record.rows["logs"][0], **lies}]})
    at = None if identity.flown_at is None else identity.flown_at.isoformat()
    common = {"vehicle": identity.vehicle, "type": identity.type, "flown_at": at}
    own = lies | {
        "id": identity.own,
        "told": identity.told,
        "flown_at_from": identity.flown_at_from,
    }
    rows = {name: [{**row, **common} for row in held] for name, held in record.rows.items()}
    (log,) = rows["logs"]
    rows["logs"] = [{**log, **own}]
    kept = [row for row in rows.get("covariates", ()) if row.get("source") != TABLE]
    head = {name: log[name] for name in ("log", "light")} | common
    told = [{**head, **row} for row in told_covariates(identity.covariates)]
    return LogRecord(record.log, rows | {"covariates": [*kept, *told]})


def renamed_light(renamed: Sequence[RenamedLog], *, followed: bool) -> Iterator[Finding]:
    """That some logs have another name or vehicle than their records have, or had.

    Parameters
    ----------
    renamed : sequence of RenamedLog
    followed : bool
        Whether their records have the new ones by now.
    """
    if not renamed:
        return
    others = [each for each in renamed if each.other_vehicle]
    first = [*others, *(each for each in renamed if not each.other_vehicle)]
    said = "; ".join(each.words for each in first[:MOST_NAMED])
    left = len(renamed) - MOST_NAMED
    said += f"; and {left} more" if left > 0 else ""
    what = "another vehicle" if len(others) == len(renamed) else "another name"
    if others and len(others) < len(renamed):
        what += f", {len(others)} of them another vehicle"
    verb = "has" if len(renamed) == 1 else "have"
    text = f"{counted(len(renamed), 'log')} {verb} {what} than in the catalogue: {said}"
    if followed:
        text = text.replace(" than in the catalogue:", " now, and so in the catalogue:")
        yield Finding("renamed-logs", Light.AMBER if others else Light.GREEN, text)
        return
    action = "flightid fleet run takes the new ones"
    yield Finding("renamed-logs", Light.AMBER if others else Light.GREEN, text, action)


def gone_light(gone: int, *, taken_out: bool = False) -> Iterator[Finding]:
    """That records stand for logs that are gone, or stood for them."""
    if not gone:
        return
    whose = f"{counted(gone, 'record')} of {'a log that is' if gone == 1 else 'logs that are'} gone"
    where = "from the places of the fleet file"
    if taken_out:
        done = "was" if gone == 1 else "were"
        said = f"{whose} {where} {done} taken out of the catalogue"
        yield Finding("gone-logs", Light.GREEN, said)
        return
    verb = "counts" if gone == 1 else "count"
    action = "flightid fleet run with --forget-gone takes them out"
    yield Finding("gone-logs", Light.GREEN, f"{whose} {where} {verb} all the same", action)


def altered_light(altered: int) -> Iterator[Finding]:
    """That logs have other bytes than their records are of, as one that was cut has."""
    if altered:
        verb, whose = ("is", "a log that has") if altered == 1 else ("are", "logs that have")
        said = f"{counted(altered, 'record')} {verb} of {whose} other bytes by now"
        action = "flightid fleet run takes what lies there now; until then the record counts"
        yield Finding("altered-logs", Light.AMBER, said, action)


def outdated_light(
    renamed: Iterable[RenamedLog], gone: int, altered: int = 0
) -> tuple[Finding, ...]:
    """All of it, of a catalogue that no run has brought up to date."""
    named = renamed_light(list(renamed), followed=False)
    return (*named, *altered_light(altered), *gone_light(gone))
