"""Which records must follow their logs: to another place, to a new time of change, or read anew."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence, Set
from dataclasses import field

from flightid.errors import FlightidError
from flightid.extras import extra_module
from flightid.fleet.addresses import LogAddress
from flightid.fleet.identity import FleetTables, LogIdentity
from flightid.fleet.missing import LogEntry, MissingLogs
from flightid.fleet.renamed import RenamedLog, renamed_identity
from flightid.fleet.settings import VehicleRules
from flightid.frozen import dataclass


@dataclass(frozen=True)
class Following:
    """What a run does about records whose logs are not as they were.

    Attributes
    ----------
    renamed : list of RenamedLog
        Logs that lie under another name.
    moved : dict of str to tuple
        By log: where it lies, and who flew it; None for a log that was touched alone.
    again : dict of str to LogAddress
        By log: those that must be read for their type or date.
    """

    renamed: list[RenamedLog] = field(default_factory=list)
    moved: dict[str, tuple[LogAddress, LogIdentity | None]] = field(default_factory=dict)
    again: dict[str, LogAddress] = field(default_factory=dict)


def following(
    missing: MissingLogs,
    known: Mapping[str, Sequence[LogAddress]],
    rules: VehicleRules,
    tables: FleetTables,
) -> Following:
    """Records that must follow; what follows is gone no more, and its vehicle is the new one.

    Parameters
    ----------
    missing : MissingLogs
        Whose `gone` and `fitted` are brought up to date.
    known : mapping of str to sequence of LogAddress
        By log: files whose bytes a record has, though it stands for none of them by address.
    rules : VehicleRules
    tables : FleetTables
    """
    plan, searched = Following(), {each.address for each in missing.addresses}
    for log, places in known.items():
        entry = missing.held.get(log)
        address = None if entry is None else _place_now(entry, places, searched)
        if entry is None or address is None:
            continue
        if address.address == entry.address:
            plan.moved[log] = (address, None)
            continue
        found = renamed_identity(entry, address, rules, tables)
        plan.renamed.append(RenamedLog.of(entry, address, rules, tables))
        if found is None:
            plan.again[log] = address
        else:
            plan.moved[log] = (address, found)
        missing.gone.pop(log, None)
        if log in missing.fitted:
            missing.fitted[log] = plan.renamed[-1].vehicle_now or ""
    return plan


def _place_now(
    entry: LogEntry, places: Sequence[LogAddress], searched: Set[str]
) -> LogAddress | None:
    """Where the log of a record lies now; None where it need not follow."""
    same = next((each for each in places if each.address == entry.address), None)
    if same is not None:
        return same
    # Where other bytes lie at its address by now, as of two names that were swapped, it has moved.
    if entry.address not in searched and _still_there(entry.address):
        return None
    return places[0]


def _still_there(address: str) -> bool:
    """Whether anything lies at the address of a record; where nobody can look it counts as there.

    Another fleet file may share the catalogue, and its logs are no concern of this one.
    """
    if "://" not in address:
        return os.path.lexists(address)
    try:
        fs, path = extra_module("fsspec", "the address of a log").core.url_to_fs(address)
        return bool(fs.exists(path))
    except (FlightidError, OSError, ValueError, ImportError):
        return True
