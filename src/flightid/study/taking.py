"""The first stage of a study: records from files, from a log, or from a flight flown now."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np

from flightid.conditioning.consistency_result import KinematicConsistency
from flightid.conventions import Role
from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.inspection import Inspection, inspect_log
from flightid.logs import Log, read_log
from flightid.logs.dataflash.sid_runs import SidRun
from flightid.logs.to_record import EXCITATION
from flightid.record import Channel, Record, Step
from flightid.record.shared_ways import joined_ways, shared_ways
from flightid.record.unit_changes import unit_changes
from flightid.study.conditioning import Conditioning, condition, outliers_first
from flightid.study.flight import FlightPlan
from flightid.study.record_files import RecordFile, declared, load_records, made_by
from flightid.study.settings import Segment, Settings
from flightid.study.stage_runner import StageResult, StageRunner
from flightid.study.task import Task
from flightid.study.truth import Truth
from flightid.vehicles import write_ardupilot_log

FLIGHT_LOG = "flight.bin"


@dataclass(frozen=True, eq=False)
class StudyRecords:
    """Records of a study, and where they come from.

    Attributes
    ----------
    records : mapping of str to StageResult list of Record
        ConditionalSpectra, by name, which may stand for all manoeuvres of a file.
    files : tuple of Path
        What was read.
    inspection : StageResult Inspection or None
    truth : Truth or None
    log : StageResult Log or None
    checks : mapping of str to KinematicConsistency
        Data compatibility, by record, where the conditioning asks for it.
    """

    records: Mapping[str, StageResult[list[Record]]]
    files: tuple[Path, ...]
    inspection: StageResult[Inspection] | None = None
    truth: Truth | None = None
    log: StageResult[Log] | None = None
    checks: Mapping[str, KinematicConsistency] = field(default_factory=dict)


def take(
    settings: Settings,
    tasks: list[Task],
    given: Path | None,
    folder: Path,
    runner: StageRunner,
    *,
    inspects: bool = True,
) -> StudyRecords:
    """Records from files, from the log given or named, or from one that is flown now.

    Without `inspects` a log is not inspected: what is cut from it does not depend on that.

    Raises
    ------
    StudyError
        A log is given to a study of records, or a file is not there.
    """
    needed = channels_needed(settings, tasks)
    checks: dict[str, KinematicConsistency] = {}
    if settings.record_files:
        if given is not None:
            raise StudyError(
                "the study reads records, not a log", found=str(given), action="leave out --log"
            )
        paths = dict.fromkeys(path for file in settings.record_files for path in file.paths)
        files = {
            file.name: runner.stage(
                f"record: {file.name}",
                load_records,
                file,
                needed[file.name],
                outliers_first(settings.conditioning, file, needed[file.name]),
            )
            for file in settings.record_files
            if file.name in needed
        }
        files |= _read_alike(files, settings, needed, runner)
        made = conditioned(files, settings.record_files, settings.conditioning, runner, checks)
        made = _in_units_of(tasks, made, runner)
        return StudyRecords(made, tuple(paths), checks=checks)
    flown, truth = _obtain_log(settings, given, folder, runner)
    opened = runner.stage("log", read_log, flown)
    mapped = settings.channel_map
    channels = {
        "channels": Path(mapped) if mapped is not None and mapped.endswith(".toml") else mapped,
        "sample_rate_hz": settings.sample_rate_hz,
        "gaps": settings.gaps,
        "max_gap_s": settings.max_gap_s,
    }
    cut = {
        segment.name: runner.stage(
            f"record: {segment.name}",
            _cut,
            opened,
            segment,
            channels,
            needed[segment.name],
            settings.injected,
        )
        for segment in settings.segments
        if segment.name in needed
    }
    inspection = runner.stage("inspection", inspect_log, opened) if inspects else None
    made = conditioned(cut, (), settings.conditioning, runner, checks)
    made = _in_units_of(tasks, made, runner)
    return StudyRecords(made, (flown,), inspection, truth, opened, checks)


def _read_alike(
    read: Mapping[str, StageResult[list[Record]]],
    settings: Settings,
    needed: Mapping[str, Mapping[str, Role]],
    runner: StageRunner,
) -> dict[str, StageResult[list[Record]]]:
    """Files whose inputs came to their grid in another way than in other records, read again."""
    found = {}
    ways = shared_ways({name: each.value for name, each in read.items()})
    for file in settings.record_files:
        again = joined_ways(file.interpolation, ways.get(file.name, {}))
        if again is not None:
            found[file.name] = runner.stage(
                f"record, inputs as in the others: {file.name}",
                load_records,
                replace(file, interpolation=again),
                needed[file.name],
                outliers_first(settings.conditioning, file, needed[file.name]),
            )
    return found


def conditioned(
    records: Mapping[str, StageResult[list[Record]]],
    files: Iterable[RecordFile],
    asked: Iterable[Conditioning],
    runner: StageRunner,
    checks: dict[str, KinematicConsistency],
) -> dict[str, StageResult[list[Record]]]:
    """Records after the steps that are meant for them; what their checks found is added."""
    made = dict(records)
    read = {file.name for file in files if file.resample_to_s is not None}
    for name, record in records.items():
        steps = tuple(
            replace(step, records=(), outliers=None if name in read else step.outliers)
            for step in asked
            if not step.records or name in step.records
        )
        if steps:
            done = runner.stage(f"conditioning: {name}", _prepare, record, steps)
            made[name] = StageResult([each for each, _ in done.value], done.key)
            checks |= {str(each.name): found for each, all_ in done.value for found in all_}
    return made


def _prepare(
    records: list[Record], steps: tuple[Conditioning, ...]
) -> list[tuple[Record, tuple[KinematicConsistency, ...]]]:
    return [condition(record, steps, str(record.name)) for record in records]


def _in_units_of(
    tasks: Sequence[Task],
    records: Mapping[str, StageResult[list[Record]]],
    runner: StageRunner,
) -> dict[str, StageResult[list[Record]]]:
    """Records in the units of the models that take them, as `identify` converts its own.

    A channel that two models want in different units stays as it is.
    """
    made = dict(records)
    for name, record in records.items():
        wanted: dict[str, set[str]] = {}
        for task in tasks:
            if task.model is not None and name in task.settings.segments:
                for channel in (*task.inputs, *task.outputs):
                    if channel in task.model.units:
                        wanted.setdefault(channel, set()).add(task.model.units[channel])
        units = {channel: min(each) for channel, each in wanted.items() if len(each) == 1}
        if any(unit_changes(each, units) for each in record.value):
            made[name] = runner.stage(f"units: {name}", _converted, record, units)
    return made


def _converted(records: list[Record], units: Mapping[str, str]) -> list[Record]:
    return [each.to_units(**unit_changes(each, units)) for each in records]


def _obtain_log(
    settings: Settings, given: Path | None, folder: Path, runner: StageRunner
) -> tuple[Path, Truth | None]:
    """Path of the log: the one given, the one the study names, or one that is flown now."""
    if given is not None or settings.flight is None:
        return given or require_log(settings.log), None
    flight = runner.stage("flight", FlightPlan.fly, settings.flight).value
    write_ardupilot_log(flight, folder / FLIGHT_LOG)
    return folder / FLIGHT_LOG, Truth.of_flight(flight)


def require_log(path: Path | None, source: Path | None = None) -> Path:
    """The log of a study, which is there.

    Parameters
    ----------
    path : Path or None
    source : Path, optional
        The study, whose first lines may name what makes the log.

    Raises
    ------
    StudyError
        It is not.
    """
    if path is None or not path.exists():
        made = "" if source is None else made_by(source)
        raise StudyError(
            "the log of the study is not there",
            found=None if path is None else str(path),
            needed="a file, or the folder of a bag",
            action=f"{made}correct [log] path, or name a log with --log",
        )
    return path


def channels_needed(settings: Settings, tasks: Iterable[Task]) -> dict[str, dict[str, Role]]:
    """Channels that the models and the conditioning take from each record, with their roles.

    Parameters
    ----------
    settings : Settings
        The study.
    tasks : iterable of Task
        Its models.

    Returns
    -------
    dict of str to dict of str to Role
        By name of the segment or record.
    """
    needed: dict[str, dict[str, Role]] = {}
    tasks = list(tasks)
    users = [(task.settings.segments, task.inputs, task.outputs) for task in tasks]
    for task in tasks:
        # A log's system-identification run brings its injection along, under this name.
        brought = settings.injected
        instruments = [each for each in task.settings.response.channels if each not in brought]
        for name in task.settings.flown:
            needed.setdefault(name, {}).update(dict.fromkeys(instruments, Role.EXCITATION))
            beside = dict.fromkeys(task.settings.response.inputs, Role.INPUT)
            needed[name].update(beside)
    # Outputs last: what one model drives and another predicts is measured.
    for role, place in ((Role.INPUT, 1), (Role.OUTPUT, 2)):
        for user in users:
            for name in user[0]:
                needed.setdefault(name, {}).update(dict.fromkeys(user[place], role))
    for step in settings.conditioning:
        for name in step.records or tuple(needed):
            for channel in step.channels:
                needed.get(name, {}).setdefault(channel, Role.OTHER)
    return needed


def _cut(
    log: Log,
    segment: Segment,
    channels: Mapping[str, Any],
    roles: Mapping[str, Role],
    injected: tuple[str, ...],
) -> list[Record]:
    record = log.record(
        names=list(roles),
        span_s=segment.span_s,
        sid_run=None if segment.sid_axis is None else sid_run(log, segment),
        roles=roles,
        name=segment.name,
        **channels,
    )
    if injected != (EXCITATION,):
        record = _with_injected(record, segment, injected)
    return [declared(record, segment.shape)]


def _with_injected(record: Record, segment: Segment, injected: tuple[str, ...]) -> Record:
    """The record's chirp under the segment's name, and zeros for those of other segments."""
    there = EXCITATION in record
    own = record[EXCITATION] if there else np.zeros(record.n_samples)
    unit = record.unit(EXCITATION) if there else "1"
    signals = {name: np.zeros(record.n_samples) for name in injected}
    signals[segment.excitation] = own
    kept = [record.channels[name] for name in record.channels if name != EXCITATION]
    made = [Channel(name, unit, Role.EXCITATION) for name in signals]
    step = Step("study.segment", {"excitation": segment.excitation})
    return record.replace(signals, channels=[*kept, *made], step=step)


def sid_run(log: Log, segment: Segment) -> SidRun:
    """System-identification run that a segment names.

    Raises
    ------
    StudyError
        The log holds no such run.
    """
    runs = [run for run in log.sid_runs if run.axis == segment.sid_axis]
    if segment.run >= len(runs):
        flown = ", ".join(str(run.axis) for run in log.sid_runs) or "none"
        raise StudyError(
            f"segment {segment.name!r}: the log holds no such system-identification run",
            found=f"runs of SID_AXIS {flown}",
            needed=f"run {segment.run} of SID_AXIS {segment.sid_axis}",
        )
    return runs[segment.run]
