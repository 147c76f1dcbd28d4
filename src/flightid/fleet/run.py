"""The verb: every log of a fleet file that the catalogue lacks, through the study."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from importlib.util import find_spec
from itertools import chain
from multiprocessing import current_process
from pathlib import Path
from time import sleep

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import Finding, counted
from flightid.fleet.addresses import NO_LOGS, LogAddress, find_logs
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
from flightid.fleet.following import following
from flightid.fleet.identity import FleetTables, identify_log, read_tables
from flightid.fleet.missing import LogEntry, MissingLogs, forget, missing_logs
from flightid.fleet.opening import current_store
from flightid.fleet.pattern_clock import require_quick
from flightid.fleet.recorded import recorded_logs
from flightid.fleet.refusal import ACTIONS, PATTERN
from flightid.fleet.renamed import (
    follow,
    gone_light,
    renamed_light,
)
from flightid.fleet.run_one import FULL, NAMING, made_record
from flightid.fleet.run_result import FleetInterrupt, FleetRun
from flightid.fleet.settings import FleetSettings, read_fleet
from flightid.fleet.taken import TakenContents
from flightid.fleet.unnamed import unnamed_light
from flightid.progress import progress


def run_fleet(
    path: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry: bool = False,
    forget_gone: bool = False,
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
    forget_gone : bool
        Take records out of the catalogue whose log is not at the places of the fleet file any more.
        Without it they count all the same.

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
        return _run(path, workers, scheduler, retry=retry, forget_gone=forget_gone)
    except OSError as error:
        if error.errno not in FULL:
            raise
        raise _no_space(str(error)) from error


def _run(
    path: str | Path,
    workers: int | None,
    scheduler: str | None,
    *,
    retry: bool,
    forget_gone: bool,
) -> FleetRun:
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
    missing = missing_logs(store, addresses, tables, retry=retry)
    findings = [*_findings(scheduler, addresses), *([] if claims else [UNCLAIMED])]
    replaced, taken = set[str](), TakenContents()
    run = _Run(settings, tables, store, order, workers, scheduler)
    before = len(addresses) - len(missing.addresses)
    seen, fresh = _seen(missing, tables)
    try:
        for outcome in chain(seen, _shown(run.outcomes(fresh), len(fresh), settings.path.stem)):
            taken.add(outcome)
            replaced |= missing.earlier.get(outcome.order.address.address, set())
    except KeyboardInterrupt as stop:
        raise FleetInterrupt(before + taken.names, len(addresses)) from stop
    replaced -= taken.outcomes.keys()
    forget(store, replaced)
    findings += _replaced(aside, replaced)
    findings += run.followed(missing, taken)
    findings += _forgotten(store, missing.gone, addresses, asked=forget_gone)
    run.tidy(1)
    counts = taken.counts()
    kept = before + counts.pop(KNOWN, 0)
    fitted = {k: v for k, v in missing.fitted.items() if k not in replaced}
    if forget_gone and addresses:
        fitted = {k: v for k, v in fitted.items() if k not in missing.gone}
    fitted |= taken.fitted
    findings += taken.findings()
    findings += filter(None, [unnamed_light(sum(not each for each in fitted.values()))])
    findings += _nothing_fitted(counts, store, len(addresses), bool(fitted))
    return FleetRun(
        settings.catalogue, len(addresses), kept, counts, tuple(findings), taken.reasons(),
        taken.copies, taken.memory_bytes,
    )  # fmt: skip


def _seen(missing: MissingLogs, tables: FleetTables) -> tuple[list[LogOutcome], list[LogOrder]]:
    """Files whose bytes the catalogue has under another name or time of change, and the others.

    No process is begun for the first, and they are no progress.
    """
    logs = recorded_logs(missing.addresses, missing.held)
    every = orders(missing.addresses, tables)
    seen = [each for each in every if each.address.address in logs]
    fresh = [each for each in every if each.address.address not in logs]
    return [LogOutcome(each, KNOWN, logs[each.address.address]) for each in seen], fresh


def _shown(outcomes: Iterable[LogOutcome], number: int, name: str) -> Iterator[LogOutcome]:
    """The same with their progress; with none there is no bar."""
    if not number:
        return
    with progress(number, name) as advance:
        for outcome in outcomes:
            yield outcome
            advance()


def _replaced(aside: Sequence[str], replaced: Set[str]) -> Iterator[Finding]:
    if aside:
        were, they, their = ("was", "it lies", "its") if len(aside) == 1 else PLURAL
        said = f"{counted(len(aside), 'part')} of the catalogue {were} damaged"
        text = f"{said}: {they} in quarantine, {their} logs were taken again"
        yield Finding("damaged-parts", Light.AMBER, text)
    if replaced:
        whose = "its log has" if len(replaced) == 1 else "their logs have"
        verb = "counts" if len(replaced) == 1 else "count"
        said = counted(len(replaced), "earlier record")
        text = f"{said} {verb} no more: {whose} other bytes now"
        yield Finding("replaced-records", Light.GREEN, text)


def _forgotten(
    store: Store, gone: Mapping[str, LogEntry], addresses: Sequence[LogAddress], *, asked: bool
) -> Iterator[Finding]:
    """Take out records of logs that are gone where that is asked; else say how many there are.

    Where nothing is found at all the logs are out of reach rather than gone.
    """
    is_taken_out = asked and bool(addresses)
    if is_taken_out:
        forget(store, set(gone))
    return gone_light(len(gone), taken_out=is_taken_out)


def _findings(scheduler: str | None, addresses: list[LogAddress]) -> Iterator[Finding]:
    if scheduler is not None and (found := scheduler_finding(scheduler)) is not None:
        yield found
    if not addresses:
        yield NO_LOGS


def _nothing_fitted(
    counts: Mapping[str, int], store: Store, found: int, fitted: bool
) -> Iterator[Finding]:
    """That a run brought nothing but failures, or that no log of the fleet has given a model."""
    if counts.get(FAILED) and counts[FAILED] == sum(counts.values()):
        text = f"{counted(counts[FAILED], 'log')} taken, and every one failed"
        action = "see the table failures for why, then flightid fleet run with --retry"
        yield Finding("all-failed", Light.RED, text, action)
    elif found and not fitted and not _has_model(store):
        text = f"no model: none of {counted(found, 'log')} could be used"
        action = "do what the commonest reason asks for, then run the fleet again"
        yield Finding("nothing-fitted", Light.RED, text, action)


def _has_model(store: Store) -> bool:
    """Whether the catalogue holds a log with a model, as of another run at the same time."""
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
PLURAL = ("were", "they lie", "their")
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
        missing = missing_logs(self.store, places, self.tables, retry=False)
        left = {each.address for each in missing.addresses}
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

    def followed(self, missing: MissingLogs, taken: TakenContents) -> tuple[Finding, ...]:
        """Records of logs that lie elsewhere now, brought there; those that must be read are taken.

        What was followed is gone no more, and its vehicle is the new one.
        """
        tables = self.tables
        plan = following(missing, taken.known, self.settings.vehicles, tables)
        follow(self.store, plan.moved)
        forget(self.store, set(plan.again))
        late = sorted(plan.again.values(), key=lambda each: each.address)
        for outcome in self.outcomes(orders(late, tables)):
            taken.add(outcome)
        return tuple(renamed_light(plan.renamed, followed=True))

    def tidy(self, at_least: int) -> None:
        """Compact where the libraries for it are installed; loose files count all the same."""
        try:
            compact(self.store, at_least=at_least)
            merge(self.store)
        except OptionError:
            return
