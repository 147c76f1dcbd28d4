"""One log through the study: a record of all its rows, whatever happens on the way."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from importlib import import_module
from pathlib import Path
from typing import Any

from flightid.conventions import Light
from flightid.errors import FileFormatError
from flightid.files import BLOCK_BYTES, sha256_of_file
from flightid.findings import worst
from flightid.fleet.addresses import LogAddress, open_address
from flightid.fleet.catalogue.record import LogRecord
from flightid.fleet.catalogue.schema import FITTED, REFUSED, TABLES
from flightid.fleet.identity import FleetTables, LogIdentity, identify_log
from flightid.fleet.refusal import (
    ACTIONS,
    MESSAGE_LENGTH,
    UNSUITED,
    UnreadableFileError,
    kind_of,
    refusal,
    unidentified,
)
from flightid.fleet.settings import FleetSettings
from flightid.fleet.study_rows import study_rows, told_covariates, usable
from flightid.frozen import dataclass
from flightid.logs import Log, read_log
from flightid.study import Study, run_study
from flightid.study.proposal import propose_study

ADDRESS, NAMING, READING, STUDY = "address", "naming", "reading", "study"
Tell = Callable[[str, str], None]
"""Takes what was begun, and the digest of the log once it is known: ahead of what may kill."""
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EROFS}


@dataclass
class Progress:
    """What is known of a log while it is being taken.

    Attributes
    ----------
    stage : str
    log : str
        Digest of its bytes; until they are read, of address and stamp.
    n_bytes : int
    """

    stage: str
    log: str
    n_bytes: int = 0


@dataclass(frozen=True)
class LogTask:
    """What one log is taken with: made once for all logs of a fleet.

    Attributes
    ----------
    settings : FleetSettings
    tables : FleetTables
    known : callable
        Whether the catalogue holds the record of a digest already.
    reports : Path or None
        Folder for every log's page.
    tell : callable
        Hears of each stage as it begins.
    """

    settings: FleetSettings
    tables: FleetTables = field(default_factory=FleetTables)
    known: Callable[[str], bool] = lambda _: False
    reports: Path | None = None
    tell: Tell = lambda _stage, _log: None


def run_one(address: LogAddress, task: LogTask, *, attempts: int = 1) -> LogRecord | None:
    """Take one log through the study of its fleet.

    The same log gives the same record, but for the columns that say that they are of this run.
    Nothing that a log holds raises: what went wrong is in the record. A full disk does, for no log
    is to blame for it.

    Parameters
    ----------
    address : LogAddress
    task : LogTask
    attempts : int
        How often the log was tried, this time included.

    Returns
    -------
    LogRecord or None
        None where the catalogue has its record already.

    Raises
    ------
    OSError
        There is no space left to work in.
    """
    begun, used = time.perf_counter(), time.process_time()
    state = Progress(ADDRESS, address.digest)
    rows: dict[str, list[dict[str, Any]]] = {}
    identity = LogIdentity(None, None, None, None)
    entry: dict[str, Any] = {}
    log: Log | None = None
    try:
        with tempfile.TemporaryDirectory(prefix="flightid-fleet-") as scratch:
            path = _fetched(address, Path(scratch), task, state)
            # A pattern that backtracks is not the log's fault: what holds it up is told ahead.
            state.stage = NAMING
            task.tell(NAMING, state.log)
            if task.known(state.log):
                return None
            rules, tables = task.settings.vehicles, task.tables
            identity = identify_log(None, address.address, address.changed_s, rules, tables)
            state.stage = READING
            task.tell(READING, state.log)
            log = read_log(path)
            identity = identify_log(log, address.address, address.changed_s, rules, tables)
            entry = {"autopilot": log.kind, "firmware": log.firmware or None}
            entry["duration_s"] = log.duration_s
            state.stage = STUDY
            task.tell(STUDY, state.log)
            study = _studied(path, Path(scratch) / "output", task, state)
            rows, entry = study_rows(study, log), entry | _verdict(study)
    except Exception as error:
        if isinstance(error, OSError) and error.errno in FULL:
            raise
        rows, entry = {}, entry | refusal(error, log)
        rows["failures"] = [_failure(error, state.stage, time.perf_counter() - begun)]
    rows["covariates"] = [*rows.get("covariates", ()), *told_covariates(identity.covariates)]
    entry |= {
        "address": address.address,
        "bytes": state.n_bytes or address.n_bytes,
        "stamp": address.stamp,
        "processor_s": time.process_time() - used,
        "memory_bytes": peak_bytes(),
        "attempts": attempts,
    }
    return made_record(state.log, identity, entry, rows)


def made_record(
    log: str,
    identity: LogIdentity,
    entry: Mapping[str, Any],
    rows: Mapping[str, list[dict[str, Any]]],
) -> LogRecord:
    """A record whose rows all begin with what is known of log and vehicle."""
    light = entry.get("light") or str(Light.RED)
    flown_at = None if identity.flown_at is None else identity.flown_at.isoformat()
    common = {
        "log": log,
        "vehicle": identity.vehicle,
        "type": identity.type,
        "flown_at": flown_at,
        "light": light,
    }
    told = {"id": identity.own, "told": identity.told, "flown_at_from": identity.flown_at_from}
    entry = {**entry, **told}
    every = {**rows, "logs": [dict(entry)]}
    return LogRecord(log, {name: [{**common, **row} for row in every.get(name, ())]
                           for name in TABLES})  # fmt: skip


def peak_bytes() -> int | None:
    """Most memory that this process has had, B; None where the system does not say."""
    try:
        resource = import_module("resource")
    except ModuleNotFoundError:
        return None
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(used) * (1 if sys.platform == "darwin" else 1024)


def _fetched(address: LogAddress, scratch: Path, task: LogTask, state: Progress) -> Path:
    """The log as a local file, its digest taken on the way, block by block."""
    task.tell(ADDRESS, state.log)
    if address.problem:
        raise UnreadableFileError(
            f"{address.name} cannot be taken as a log: {address.problem}",
            needed="a regular file under a name in UTF-8",
            action="mend or remove it",
        )
    most = task.settings.limits.log_mib << 20
    local = address.local
    if local is not None:
        state.n_bytes = local.stat().st_size
        _require_length(local.name, state.n_bytes, most)
        state.log = sha256_of_file(local)
        return local
    digest, path = hashlib.sha256(), scratch / address.name
    with open_address(address.address) as source, path.open("wb") as target:
        while block := source.read(BLOCK_BYTES):
            digest.update(block)
            target.write(block)
            state.n_bytes += len(block)
            _require_length(address.name, state.n_bytes, most)
    state.log = digest.hexdigest()
    return path


def _require_length(name: str, n_bytes: int, most: int) -> None:
    if n_bytes > most:
        raise FileFormatError(
            f"{name} is longer than a log of this fleet may be",
            found=f"{n_bytes >> 20:,} MiB or more",
            needed=f"at most {most >> 20:,} MiB",
            action="raise log_mib in [limits] of the fleet file",
        )


def _studied(path: Path, output: Path, task: LogTask, state: Progress) -> Study:
    """The study of the fleet carried out with a log, as `flightid run` does it."""
    study, cache = task.settings.study, dict[str, Any]()
    with _quiet():
        if study is None:
            made = propose_study((path,), folder=output.parent, cache=cache)
            if not made.models:
                raise unidentified(made)
            study = output.with_name("study.toml")
            made.write(study)
        found = run_study(study, output=output, log=path, cache=cache)
    if task.reports is not None:
        place = task.reports / f"{state.log[:16]}.html"
        task.reports.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(output / "report.html", place)
    return found


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Warnings of libraries are no affair of thousands of logs: findings say what counts."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _verdict(study: Study) -> dict[str, Any]:
    """What the log's own row says of a study that was carried out."""
    good = [item for item in study.identified if usable(item.fit)]
    entry: dict[str, Any] = {
        "models": len(good),
        "outcome": FITTED if good else REFUSED,
        "light": str(worst([item.fit.evidence.verdict for item in good if item.fit is not None])),
        "frame": study.review.identity.frame or None if study.review is not None else None,
    }
    if good:
        return entry
    red = [
        finding
        for item in study.identified
        for finding in (
            *item.left_out,
            *(() if item.fit is None else (item.fit.evidence.reason,)),
            *item.findings,
        )
        if finding is not None and finding.light in (Light.RED, Light.UNKNOWN)
    ]
    first = red[0] if red else None
    told = ("no-intervals", "no model has intervals", "") if first is None else (
        first.code, first.message, first.action)  # fmt: skip
    return entry | {
        "light": str(Light.RED),
        "reason": told[0],
        "message": told[1],
        "action": told[2] or ACTIONS.get(told[0], ACTIONS[UNSUITED]),
    }


def _failure(error: Exception, stage: str, elapsed_s: float) -> dict[str, Any]:
    return {
        "kind": kind_of(error),
        "message": str(error)[:MESSAGE_LENGTH],
        "stage": stage,
        "elapsed_s": elapsed_s,
        "memory_bytes": peak_bytes(),
    }
