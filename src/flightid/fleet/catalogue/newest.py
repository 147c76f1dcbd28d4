"""Which record of a log counts, where several sets or parts hold one: the newest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flightid.fleet.catalogue.compaction import read_columns
from flightid.fleet.catalogue.loose import loose_logs, read_loose
from flightid.fleet.catalogue.parts import KEY_BYTES, KnownLogs, TablePart, read_keys, read_parts
from flightid.fleet.catalogue.record import LogRecord
from flightid.fleet.catalogue.store import Store
from flightid.frozen import dataclass

LOOSE = ""
"""Stands for the loose files of a set where a part has its name."""


@dataclass(frozen=True)
class VersionRecords:
    """All records of one study and version.

    Attributes
    ----------
    store : Store
    parts : tuple of TablePart
    records : tuple of LogRecord
        Loose ones that no part holds.
    broken : tuple of str
        Parts that cannot be used.
    """

    store: Store
    parts: tuple[TablePart, ...]
    records: tuple[LogRecord, ...]
    broken: tuple[str, ...]

    @classmethod
    def of(cls, store: Store) -> VersionRecords:
        """What lies in a store."""
        parts, broken = read_parts(store)
        known = KnownLogs(store, parts)
        loose = (log for log in loose_logs(store) if not known.in_parts(log))
        return cls(store, tuple(parts), tuple(read_loose(store, loose)), tuple(broken))


def older_records(sets: Sequence[VersionRecords]) -> dict[tuple[int, str], list[str]]:
    """Logs of which a newer record stands elsewhere, by place of the set and part.

    Of records of one instant the one of the earlier set, and of its first part, counts.
    """
    places, keys = list[tuple[int, str]](), list[np.ndarray]()
    for number, each in enumerate(sets):
        for part in each.parts:
            places.append((number, part.name))
            keys.append(read_keys(each.store, part))
        if each.records:
            joined = b"".join(bytes.fromhex(record.log) for record in each.records)
            places.append((number, LOOSE))
            keys.append(np.frombuffer(joined, dtype=f"V{KEY_BYTES}"))
    if len(places) < 2:
        return {}
    origin = np.repeat(np.arange(len(places)), [len(each) for each in keys])
    every = np.concatenate(keys)
    names, first, counts = np.unique(
        every.view(f"S{KEY_BYTES}"), return_inverse=True, return_counts=True
    )
    del names
    several = np.flatnonzero(counts[first] > 1)
    if not len(several):
        return {}
    written = {at: _written(sets, places[at]) for at in sorted(set(origin[several].tolist()))}
    best: dict[str, int] = {}
    for row in several:
        log, at = every[row].tobytes().hex(), int(origin[row])
        if log not in best or written[at].get(log, "") > written[best[log]].get(log, ""):
            best[log] = at
    older: dict[tuple[int, str], list[str]] = {}
    for row in several:
        log, at = every[row].tobytes().hex(), int(origin[row])
        if best[log] != at:
            older.setdefault(places[at], []).append(log)
    return older


def _written(sets: Sequence[VersionRecords], place: tuple[int, str]) -> dict[str, str]:
    """When each record of a part, or of the loose files, was written, as text that sorts."""
    number, name = place
    found = sets[number]
    if name == LOOSE:
        rows = ((e.log, str(e.rows["logs"][0].get("recorded_at") or "")) for e in found.records)
        return {log: at.replace("T", " ") for log, at in rows}
    parts = [part for part in found.parts if part.name == name]
    return dict(read_columns(found.store, parts, "logs", ("log", "recorded_at")))  # type: ignore[arg-type]  # pairs
