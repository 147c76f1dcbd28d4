"""The verb: every log of a fleet file that the catalogue lacks, through the study."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, replace
from importlib.util import find_spec
from multiprocessing import current_process
from pathlib import Path
from time import sleep

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import Finding, counted
from flightid.fleet.addresses import LogAddress, find_logs
from flightid.fleet.catalogue.compaction import compact, merge, set_aside
from flightid.fleet.catalogue.loose import loose_logs, read_loose, write_loose
from flightid.fleet.catalogue.parts import read_parts
from flightid.fleet.catalogue.schema import FAILED, FITTED
from flightid.fleet.catalogue.store import Store
from flightid.fleet.engine.claims import ClaimWatch, can_claim, new_claimant
from flightid.fleet.engine.cluster import require_address, run_cluster, scheduler_finding
from flightid.fleet.engine.order import (
    CLAIMED,
    KILLED,
    KNOWN,
    STORAGE,
    LogOrder,
    LogOutcome,
    RunOrder,
    orders,
    run_order,
)
from flightid.fleet.engine.plain import run_plain
from flightid.fleet.engine.sandbox import TIME
from flightid.fleet.identity import FleetTables, identify_log, read_tables
from flightid.fleet.missing import forget, missing_logs
from flightid.fleet.opening import current_store
from flightid.fleet.pattern_clock import require_quick
from flightid.fleet.reasons import RefusalReason
from flightid.fleet.refusal import ACTIONS, PATTERN
from flightid.fleet.run_one import FULL, NAMING, made_record
from flightid.fleet.settings import FleetSettings, read_fleet
from flightid.fleet.taken import TakenContents
from flightid.fleet.unnamed import named_logs, unnamed_light, unnamed_logs
from flightid.frozen import dataclass
from flightid.progress import progress
from flightid.result import Result
from flightid.table import Column, Table


@dataclass(frozen=True, repr=False)
class FleetRun(Result, schema="flightid.fleet_run/1"):
    """What one run of a fleet did.

    Attributes
    ----------
    catalogue : str
        Folder or address.
    found : int
        Logs at the places of the fleet file.
    kept : int
        Of these, in the catalogue before, or taken by another run at the same time.
    outcomes : mapping of str to int
        Those that were taken, by outcome.
    findings : tuple of Finding
    reasons : tuple of RefusalReason
        Why those that were taken and gave no model did not, the commonest first.
    copies : mapping of str to str
        Addresses whose bytes another log had that was taken, and its address: found is the sum of
        what was kept, all outcomes and these.

    Example
    -------
    >>> FleetRun("catalogue", 3, 1, {"fitted": 2})
    FleetRun(3 logs, 1 kept, 2 fitted)
    """

    catalogue: str
    found: int
    kept: int
    outcomes: dict[str, int]
    findings: tuple[Finding, ...] = ()
    reasons: tuple[RefusalReason, ...] = ()
    copies: Mapping[str, str] = field(default_factory=dict)

    def summary(self) -> Table:
        """Table of the numbers."""
        rows: list[tuple[str, int]] = [("logs found", self.found), ("kept", self.kept)]
        rows += [(f"{name} logs", n) for name, n in sorted(self.outcomes.items())]
        rows += [("copies of these", len(self.copies))] if self.copies else []
        columns = (Column("what"), Column("number"))
        return Table(f"Run of {self.catalogue}", columns, tuple(rows))

    def __repr__(self) -> str:
        """Numbers of logs on one line."""
        told = ", ".join(f"{n} {name}" for name, n in sorted(self.outcomes.items())) or "none taken"
        return f"FleetRun({self.found} logs, {self.kept} kept, {told})"


class FleetInterrupt(KeyboardInterrupt):
    """Ctrl-C in a run: what is in the catalogue, and how to go on.

    Parameters
    ----------
    done, found : int
        Logs that are in the catalogue, and all at the places of the fleet file.
    """

    def __init__(self, done: int, found: int) -> None:
        super().__init__(
            f"Interrupted: {done} of {counted(found, 'log')} in the catalogue; the same command "
            "takes the rest."
        )


def run_fleet(
    path: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry: bool = False,
) -> FleetRun:
    """Take every log of a fleet file that its catalogue lacks.

    A log that fails costs itself alone, and is in the catalogue with the reason. Whatever ends a
    run, the next one takes what is missing; several may run at once.

    Parameters
    ----------
    path : str or Path
        Fleet file; docs/fleet.md describes it.
    workers : int, optional
        Processes on this machine; default: one a processor.
    scheduler : str, optional
        Address of a Dask scheduler whose workers take the logs: ``"tls://host:8786"``.
    retry : bool
        Take logs again that failed: out of time or memory, or by a fault.

    Returns
    -------
    FleetRun

    Raises
    ------
    StudyError
        Fleet file or study cannot be carried out as written.
    OptionError
        No scheduler answers, or a library is missing.
    DataError
        The cluster is gone, or the catalogue cannot be written any more.
    FleetInterrupt
        Ctrl-C, with how many logs are done: the next run takes the others.

    Example
    -------
    >>> import flightid as fid
    >>> fid.fleet.run_fleet("fleet.toml", workers=1)
    FleetRun(2 logs, 0 kept, 2 refused)
    """
    try:
        return _run(path, workers, scheduler, retry=retry)
    except OSError as error:
        if error.errno not in FULL:
            raise
        raise _no_space(str(error)) from error


def _run(path: str | Path, workers: int | None, scheduler: str | None, *, retry: bool) -> FleetRun:
    settings = read_fleet(path)
    tables = read_tables(settings)
    if scheduler is not None:
        require_address(scheduler)
    store = current_store(settings)
    claims = can_claim(store)
    claimant = new_claimant() if claims else ""
    order = replace(run_order(settings, tables, store.root), claimant=claimant)
    aside = set_aside(store)
    addresses = find_logs([settings.place(place) for place in settings.words.logs])
    require_quick(settings.vehicles.pattern, (each.name for each in addresses))
    missing, earlier = missing_logs(store, addresses, tables, retry=retry)
    findings = [*_findings(scheduler, addresses), *([] if claims else [UNCLAIMED])]
    replaced, taken = set[str](), TakenContents()
    run = _Run(settings, tables, store, order, workers, scheduler)
    before = len(addresses) - len(missing)
    try:
        with progress(len(missing), settings.path.stem) as advance:
            for outcome in run.outcomes(orders(missing, tables)):
                taken.add(outcome)
                replaced |= earlier.get(outcome.order.address.address, set())
                advance()
    except KeyboardInterrupt as stop:
        raise FleetInterrupt(before + taken.names, len(addresses)) from stop
    replaced -= taken.outcomes.keys()
    forget(store, replaced)
    run.tidy(1)
    counts = taken.counts()
    kept = before + counts.pop(KNOWN, 0)
    if aside:
        text = (
            f"{len(aside)} tables were damaged: they lie in quarantine, their logs were taken again"
        )
        findings.append(Finding("damaged-parts", Light.AMBER, text))
    if replaced:
        text = f"{len(replaced)} earlier records count no more: their logs have other bytes now"
        findings.append(Finding("replaced-records", Light.GREEN, text))
    findings += taken.findings()
    findings += filter(None, [unnamed_light(unnamed_logs(named_logs(store)))])
    findings += _nothing_fitted(counts, store, len(addresses))
    return FleetRun(
        settings.catalogue, len(addresses), kept, counts, tuple(findings), taken.reasons(),
        taken.copies,
    )  # fmt: skip


def _findings(scheduler: str | None, addresses: list[LogAddress]) -> Iterator[Finding]:
    if scheduler is not None and (found := scheduler_finding(scheduler)) is not None:
        yield found
    if not addresses:
        yield Finding(
            "no-logs",
            Light.RED,
            "there is no log at the places of the fleet file",
            "name folders, globs or addresses in [fleet] logs",
        )


def _nothing_fitted(counts: Mapping[str, int], store: Store, found: int) -> Iterator[Finding]:
    """That a run brought nothing but failures, or that no log of the fleet has given a model."""
    if counts.get(FAILED) and counts[FAILED] == sum(counts.values()):
        text = f"{counted(counts[FAILED], 'log')} taken, and every one failed"
        action = "see the table failures for why, then flightid fleet run with --retry"
        yield Finding("all-failed", Light.RED, text, action)
    elif found and not _has_model(store):
        text = f"no model: none of {counted(found, 'log')} could be used"
        action = "do what the commonest reason asks for, then run the fleet again"
        yield Finding("nothing-fitted", Light.RED, text, action)


def _has_model(store: Store) -> bool:
    """Whether the catalogue holds a log with a model."""
    if any(part.outcomes.get(FITTED) for part in read_parts(store)[0]):
        return True
    return any(record.outcome == FITTED for record in read_loose(store, loose_logs(store)))


def _no_space(found: str) -> DataError:
    return DataError(
        "nothing can be written any more",
        found=found,
        needed="space where the catalogue and temporary files lie",
        action="make room and run the fleet again: only what is missing is taken",
    )


UNCLAIMED = Finding(
    "no-claims",
    Light.GREEN,
    "the catalogue's place keeps no two runs off one log: at the same time they take logs twice",
    "give runs at the same time a part of the addresses each",
)
POLL_S = 1.0
"""Time between looks at logs that other runs hold."""


class _Run:
    """One run: its engine, its second tries, its compactions."""

    def __init__(
        self,
        settings: FleetSettings,
        tables: FleetTables,
        store: Store,
        order: RunOrder,
        workers: int | None,
        scheduler: str | None,
    ) -> None:
        self.settings, self.tables, self.store, self.order = settings, tables, store, order
        self.workers, self.scheduler = workers, scheduler
        self.written = 0

    def outcomes(self, logs: list[LogOrder]) -> Iterator[LogOutcome]:
        """Outcomes of all logs; those that killed their process are tried once more, alone.

        Those that another run is at come last: they are known then, or its holder is gone.
        """
        again, held, free = list[LogOrder](), list[LogOrder](), logs
        watch = ClaimWatch(self.store)
        while free or held:
            for outcome in self._taken(free, self.workers) if free else ():
                if outcome.outcome == KILLED:
                    again.append(replace(outcome.order, attempts=2))
                elif outcome.outcome == CLAIMED:
                    held.append(outcome.order)
                else:
                    yield self._counted(outcome)
            free = [each for each in held if watch.is_free(each.address.digest)]
            held = [each for each in held if each not in free]
            done, free = self._parted(free)
            yield from (LogOutcome(each, KNOWN, each.address.digest) for each in done)
            if held and not free:
                sleep(POLL_S)
        for log in again:
            for outcome in self._taken([log], 1):
                if outcome.outcome == CLAIMED:  # Another run tries it, and tells what comes of it.
                    yield replace(outcome, outcome=KNOWN)
                else:
                    killed = outcome.outcome == KILLED
                    yield self._counted(self._failed(outcome) if killed else outcome)

    def _parted(self, free: list[LogOrder]) -> tuple[list[LogOrder], list[LogOrder]]:
        """Logs that another run has given back: those that it has done, and the others."""
        if not free:
            return [], []
        places = [each.address for each in free]
        left = {e.address for e in missing_logs(self.store, places, self.tables, retry=False)[0]}
        return (
            [each for each in free if each.address.address not in left],
            [each for each in free if each.address.address in left],
        )

    def _taken(self, logs: list[LogOrder], workers: int | None) -> Iterable[LogOutcome]:
        # A worker of a server may have no children but by a shell's call, which plain runs make.
        clustered = find_spec("distributed") and not current_process().daemon
        if self.scheduler is not None or (clustered and len(logs) > 1):
            return run_cluster(self.order, logs, workers, self.scheduler)
        return run_plain(self.order, logs, workers)

    def _counted(self, outcome: LogOutcome) -> LogOutcome:
        if outcome.outcome == STORAGE:
            raise _no_space(outcome.message)
        self.written += 1
        if self.written % self.settings.limits.compact_every == 0:
            self.tidy(self.settings.limits.compact_every // 2)
        return outcome

    def _failed(self, outcome: LogOutcome) -> LogOutcome:
        """The record of a log that killed its process twice."""
        address = outcome.order.address
        rules = self.settings.vehicles
        if outcome.stage == NAMING and outcome.reason == TIME:
            said = f"the pattern {rules.pattern!r} of [vehicles] does not come to an end here"
            outcome = replace(outcome, reason=PATTERN, message=said)
        if rules.by == "name":
            # The pattern may be what hung the process: here nobody has a clock on it.
            rules = replace(rules, by="log", pattern=None)
        identity = identify_log(None, address.address, address.changed_s, rules, self.tables)
        entry = {
            "address": address.address,
            "bytes": address.n_bytes,
            "stamp": address.stamp,
            "outcome": FAILED,
            "reason": outcome.reason,
            "message": outcome.message,
            "action": ACTIONS.get(outcome.reason),
            "models": 0,
            "attempts": outcome.order.attempts,
        }
        failure = {
            "kind": outcome.reason,
            "message": outcome.message,
            "stage": outcome.stage,
            "signal": outcome.signal,
            "elapsed_s": outcome.elapsed_s,
        }
        rows = {"failures": [failure]}
        write_loose(self.store, made_record(outcome.log, identity, entry, rows))
        return replace(outcome, outcome=FAILED, action=ACTIONS.get(outcome.reason, ""))

    def tidy(self, at_least: int) -> None:
        """Compact where the libraries for it are installed; loose files count all the same."""
        try:
            compact(self.store, at_least=at_least)
            merge(self.store)
        except OptionError:
            return
