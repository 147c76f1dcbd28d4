"""The first stage of a study: records from files, from a log, or from a flight flown now."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from flightid.conventions import Role
from flightid.errors import StudyError
from flightid.inspection import Inspection, inspect_log
from flightid.logs import Log, read_log
from flightid.logs.dataflash.sid_runs import SidRun
from flightid.record import Record
from flightid.study.conditioning import condition
from flightid.study.flown import Flown
from flightid.study.record_files import ALL, load_records
from flightid.study.response_settings import EXCITATION
from flightid.study.settings import Segment, Settings
from flightid.study.stages import Task
from flightid.study.truth import Truth
from flightid.vehicles import write_ardupilot_log

FLIGHT_LOG = "flight.bin"


@dataclass(frozen=True, eq=False)
class Taken:
    """Records of a study, and where they come from.

    Attributes
    ----------
    records : Flown
        Conditioned, by name.
    files : tuple of Path
        What was read.
    inspection : Inspection or None
    truth : Truth or None
    log : Log or None
    """

    records: Flown
    files: tuple[Path, ...]
    inspection: Inspection | None = None
    truth: Truth | None = None
    log: Log | None = None


def take(settings: Settings, tasks: list[Task], given: Path | None, folder: Path) -> Taken:
    """Records from files, from the log given or named, or from one that is flown now.

    Raises
    ------
    StudyError
        A log is given to a study of records, or a file is not there.
    """
    needed = channels_needed(settings, tasks)
    if settings.record_files:
        if given is not None:
            raise StudyError(
                "the study reads records, not a log", found=str(given), action="leave out --log"
            )
        paths = dict.fromkeys(file.path for file in settings.record_files)
        wanted = [file for file in settings.record_files if file.name in needed]
        read = {file.name: load_records(file, needed[file.name]) for file in wanted}
        groups = {
            file.name: tuple(record.name for record in read[file.name])
            for file in wanted
            if file.manoeuvre == ALL
        }
        flat = {record.name: record for found in read.values() for record in found}
        return Taken(_conditioned(flat, groups, settings), tuple(paths))
    flown, truth = _obtain_log(settings, given, folder)
    opened = read_log(flown)
    cut = {
        segment.name: _cut(opened, segment, settings, needed[segment.name])
        for segment in settings.segments
        if segment.name in needed
    }
    return Taken(_conditioned(cut, {}, settings), (flown,), inspect_log(opened), truth, opened)


def _conditioned(
    records: Mapping[str, Record], groups: Mapping[str, tuple[str, ...]], settings: Settings
) -> Flown:
    group_of = {member: name for name, members in groups.items() for member in members}
    done = {
        name: condition(record, settings.conditioning, group_of.get(name, name))
        for name, record in records.items()
    }
    return Flown(done, groups)


def _obtain_log(settings: Settings, given: Path | None, folder: Path) -> tuple[Path, Truth | None]:
    """Path of the log: the one given, the one the study names, or one that is flown now."""
    if given is not None or settings.flight is None:
        return given or _required(settings.log), None
    flight = settings.flight.fly()
    write_ardupilot_log(flight, folder / FLIGHT_LOG)
    return folder / FLIGHT_LOG, Truth.of_flight(flight)


def _required(path: Path | None) -> Path:
    if path is None or not path.is_file():
        raise StudyError(
            "the log of the study is not there",
            found=None if path is None else str(path),
            needed="a file",
            action="correct [log] path, or name a log with --log",
        )
    return path


def channels_needed(settings: Settings, tasks: Iterable[Task]) -> dict[str, dict[str, Role]]:
    """Channels that the models and the conditioning take from each record, with their roles.

    Parameters
    ----------
    settings : Settings
        The study.
    tasks : iterable of Task
        Its models with equations.

    Returns
    -------
    dict of str to dict of str to Role
        By name of the segment or record.
    """
    needed: dict[str, dict[str, Role]] = {}
    tasks = list(tasks)
    users = [(task.settings.segments, task.model.inputs, task.model.outputs) for task in tasks]
    users += [(box.segments, box.inputs, (box.output,)) for box in settings.black_boxes]
    for task in tasks:
        # A log's system-identification run brings its injection along, under this name.
        brought = (EXCITATION,) if settings.segments else ()
        instruments = [each for each in task.settings.response.channels if each not in brought]
        for name in task.settings.identify:
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


def _cut(log: Log, segment: Segment, settings: Settings, roles: Mapping[str, Role]) -> Record:
    return log.record(
        settings.channel_map,
        names=list(roles),
        span_s=segment.span_s,
        sid_run=None if segment.sid_axis is None else sid_run(log, segment),
        sample_rate_hz=settings.sample_rate_hz,
        roles=roles,
        gaps=settings.gaps,
        max_gap_s=settings.max_gap_s,
        name=segment.name,
    )


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
