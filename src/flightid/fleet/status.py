"""How far a fleet is: which files are taken, which are copies, and why some gave no model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.fleet.addresses import NO_LOGS, find_logs
from flightid.fleet.catalogue.compaction import read_columns
from flightid.fleet.catalogue.loose import QUARANTINE, loose_logs, read_loose
from flightid.fleet.catalogue.parts import PARTS, KnownLogs, TablePart, read_parts
from flightid.fleet.catalogue.store import Store
from flightid.fleet.opening import (
    catalogue_place,
    earlier_light,
    has_catalogue,
    names_fleet_file,
    opened_store,
)
from flightid.fleet.reasons import RefusalReason, grouped_reasons
from flightid.fleet.settings import FleetSettings, read_fleet
from flightid.fleet.shares import FleetShares, fleet_shares
from flightid.fleet.unnamed import unnamed_light, unnamed_logs
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Column, Table


@dataclass(frozen=True)
class FleetStatus(Result, schema="flightid.fleet_status/1"):
    """How far a fleet is.

    Attributes
    ----------
    catalogue : str
        Folder or address.
    found : int or None
        Logs at the places of the fleet file; None where the catalogue alone was named.
    outcomes : mapping of str to int
        Logs in the catalogue by outcome.
    parts, loose : int
        Compacted tables, and files that are not compacted yet.
    quarantine : tuple of str
        Records and parts that could not be read, each once however many files it is.
    n_bytes : int
        Size of parts and loose files, B.
    reasons : tuple of RefusalReason
        Why logs gave no model, the commonest first; of compacted ones where the extra is installed.
    shares : FleetShares or None
        Where each file stands; None where the catalogue alone was named, or without the extra.
    unnamed : int
        Logs with a model that name no vehicle, and count in no answer.
    findings : tuple of Finding
        These, logs with another name, vehicle or bytes than their records, records of logs that
        are gone; or that nothing was run yet.

    Example
    -------
    >>> FleetStatus("catalogue", None, {"fitted": 2}, 1, 0)
    FleetStatus(2 fitted)
    """

    catalogue: str
    found: int | None
    outcomes: Mapping[str, int]
    parts: int
    loose: int
    quarantine: tuple[str, ...] = ()
    n_bytes: int = 0
    reasons: tuple[RefusalReason, ...] = ()
    shares: FleetShares | None = None
    unnamed: int = 0
    findings: tuple[Finding, ...] = ()

    @property
    def n_logs(self) -> int:
        """Logs in the catalogue."""
        return sum(self.outcomes.values())

    def summary(self) -> Table:
        """Table of the numbers: what is found is the sum of what stands below it."""
        rows: list[tuple[str, int | str | None]] = [("logs found", self.found)]
        shares = self.shares
        outcomes = self.outcomes if shares is None else shares.outcomes
        rows += [(f"{name} logs", n) for name, n in sorted(outcomes.items())]
        if shares is not None:
            rows += [
                ("copies of these", len(shares.copies)),
                ("not taken yet", len(shares.waiting)),
            ]
            left = (("are gone", shares.gone), ("have other bytes now", shares.altered))
            rows += [(f"records of files that {what}", len(e)) for what, e in left if e]
        rows += [("parts", self.parts), ("loose files", self.loose)]
        rows += [
            ("records and parts in quarantine", len(self.quarantine)),
            ("size [MB]", f"{self.n_bytes / 1e6:.2f}"),
        ]
        return Table(f"Catalogue {self.catalogue}", (Column("what"), Column("number")), tuple(rows))

    def __repr__(self) -> str:
        """Numbers of logs on one line."""
        told = ", ".join(f"{n} {name}" for name, n in sorted(self.outcomes.items())) or "no logs"
        return f"FleetStatus({told})"


def fleet_status(place: str | Path) -> FleetStatus:
    """Count what is in a catalogue.

    Parameters
    ----------
    place : str or Path
        Fleet file (``*.toml``), whose places are counted too, or the catalogue's folder or address.

    Raises
    ------
    DataError
        There is no catalogue at a place that is no fleet file; of one that no run has taken yet its
        logs are counted.

    Example
    -------
    >>> import flightid as fid
    >>> fid.fleet.fleet_status("fleet.toml")
    FleetStatus(40 fitted, 3 refused)
    """
    where = catalogue_place(place)
    if not names_fleet_file(place):
        return _counted(opened_store(where), where)
    settings = read_fleet(place)
    if not has_catalogue(where):
        return _before_a_run(settings, where)
    store = opened_store(where)
    shares, found = fleet_shares(settings, store)
    gone = frozenset(() if shares is None else shares.unheld)
    findings = (*earlier_light(settings, store), *(() if shares is None else shares.findings))
    counted = _counted(store, where, gone)
    return replace(counted, found=found, shares=shares, findings=(*findings, *counted.findings))


def _before_a_run(settings: FleetSettings, where: str) -> FleetStatus:
    """Of a fleet file that no run has taken: its logs, all of them waiting."""
    found = find_logs([settings.place(each) for each in settings.words.logs])
    waiting = tuple(each.address for each in found)
    action = "flightid fleet run takes all of them"
    told = Finding("no-catalogue", Light.UNKNOWN, "nothing was run yet", action)
    shares = FleetShares({}, {}, waiting, ())
    return FleetStatus(
        *(where, len(found), {}, 0, 0), shares=shares, findings=(told if found else NO_LOGS,)
    )


def _counted(store: Store, where: str, gone: Collection[str] = ()) -> FleetStatus:
    """All of a catalogue; reasons without those of files that are gone or have other bytes."""
    parts, broken = read_parts(store)
    known = KnownLogs(store, parts)
    loose = [log for log in loose_logs(store) if not known.in_parts(log)]
    counts = Counter[str]()
    for part in parts:
        counts.update(part.outcomes)
    n_bytes = sum(size for part in parts for size in part.sizes.values())
    told = list(_told(store, parts))
    for record in read_loose(store, loose):
        counts[record.outcome] += 1
        told.append(record.rows["logs"][0])
        n_bytes += len(record.to_bytes())
    kept = dict.fromkeys(name.partition(".")[0] for name in sorted(store.names(QUARANTINE)))
    unusable = (*(f"{QUARANTINE}/{e}" for e in kept), *(f"{PARTS}/{name}" for name in broken))
    return FleetStatus(
        where, None, dict(counts), len(parts), len(loose), unusable, n_bytes,
        grouped_reasons(row for row in told if row["address"] not in gone),
        unnamed=unnamed_logs(told),
        findings=tuple(filter(None, [unnamed_light(unnamed_logs(told))])),
    )  # fmt: skip


def _told(store: Store, parts: Sequence[TablePart]) -> Iterator[Mapping[str, Any]]:
    """What became of the logs of parts; nothing without the library that reads them."""
    names = ("outcome", "reason", "message", "action", "address", "vehicle")
    try:
        for row in read_columns(store, parts, "logs", names):
            yield dict(zip(names, row, strict=True))
    except OptionError:
        return
