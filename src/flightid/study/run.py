"""The verb: a study file carried out from end to end."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from flightid.errors import StudyError
from flightid.files import sha256_of_file
from flightid.inspection import Inspection, inspect_log
from flightid.logs import Log, read_log
from flightid.progress import progress
from flightid.record import Record
from flightid.report.html import to_html
from flightid.report.text import to_text
from flightid.study.black_box import identify_black_box
from flightid.study.output import RESULTS, require_replaceable, whole_folder
from flightid.study.qualities import rate_models, require_pairs
from flightid.study.settings import Settings, read_settings
from flightid.study.stages import (
    Identified,
    Task,
    channels_needed,
    check,
    cut_records,
    estimate,
    fit,
    load_records,
    load_task,
)
from flightid.study.study import Study
from flightid.study.truth import Truth
from flightid.study.tuning import TuneSettings, tune_models
from flightid.vehicles import write_ardupilot_log

FLIGHT_LOG = "flight.bin"


def run_study(
    path: str | Path,
    *,
    output: str | Path | None = None,
    log: str | Path | None = None,
    tune: bool = False,
) -> Study:
    """Carry out a study file: log or records, responses, models, verification, report.

    The output folder appears whole or not at all.

    Parameters
    ----------
    path : str or Path
        Study file; docs/study.md describes it.
    output : str or Path, optional
        Folder to write; default: ``<study>-output`` beside the study file.
    log : str or Path, optional
        Log to read instead of the one that the study names.
    tune : bool
        Tune gains with the usual requirements where the study does not say any.

    Returns
    -------
    Study

    Raises
    ------
    StudyError
        The study file cannot be carried out as written.
    FlightidError
        A stage refuses its data; the class and the message are those of the stage.
    OSError
        A file cannot be read, or the folder cannot be written.

    Example
    -------
    >>> import flightid as fid
    >>> study = fid.run_study("examples/quadrotor_rig/study.toml")   # doctest: +SKIP
    >>> study.output / "report.html"                                 # doctest: +SKIP
    """
    source = Path(path)
    settings = read_settings(source)
    final = Path(output) if output is not None else source.with_name(f"{source.stem}-output")
    require_replaceable(final)
    tasks = [load_task(model, on_records=settings.on_records) for model in settings.models]
    rated = settings.qualities
    if rated is not None:
        require_pairs(tasks, rated)
    # Reading and cutting, three steps for each model, writing; a flight before all of it.
    steps = 3 + 3 * (len(tasks) + len(settings.black_boxes))
    with whole_folder(final) as folder, progress(steps, source.stem) as advance:
        taken = _take(settings, tasks, None if log is None else Path(log), folder)
        advance(2)
        identified = tuple(_identify(task, taken.records, settings, advance) for task in tasks)
        boxes = []
        for asked in settings.black_boxes:
            boxes.append(identify_black_box(asked, taken.records))
            advance(3)
        wanted = settings.tune or (TuneSettings() if tune else None)
        tuning = None if wanted is None else tune_models(identified, taken.log, wanted)
        files = {item.name: sha256_of_file(item) for item in (source, *taken.files)}
        study = Study(
            settings,
            final,
            taken.inspection,
            taken.records,
            identified,
            tuple(boxes),
            taken.truth,
            files,
            tuning,
            {} if rated is None else rate_models(identified, rated),
        )
        _write(study, folder)
        advance()
    return study


@dataclass(frozen=True, eq=False)
class _Taken:
    """Records of a study, and where they come from."""

    records: Mapping[str, Record]
    files: tuple[Path, ...]
    inspection: Inspection | None = None
    truth: Truth | None = None
    log: Log | None = None


def _take(settings: Settings, tasks: list[Task], given: Path | None, folder: Path) -> _Taken:
    """Records from files, from the log given or named, or from one that is flown now."""
    needed = channels_needed(settings, tasks)
    if settings.record_files:
        if given is not None:
            raise StudyError(
                "the study reads records, not a log", found=str(given), action="leave out --log"
            )
        paths = dict.fromkeys(file.path for file in settings.record_files)
        return _Taken(load_records(settings, needed), tuple(paths))
    flown, truth = _obtain_log(settings, given, folder)
    opened = read_log(flown)
    records = cut_records(opened, settings, needed)
    return _Taken(records, (flown,), inspect_log(opened), truth, opened)


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


def _identify(
    task: Task, records: Mapping[str, Record], settings: Settings, advance: Callable[..., None]
) -> Identified:
    responses = estimate(task, records, settings)
    advance()
    fits, reduction = fit(task, responses, records, settings)
    advance()
    verifications = check(task, next(iter(fits.values())), records, settings)
    advance()
    return Identified(task.settings, responses, fits, verifications, reduction)


def _write(study: Study, folder: Path) -> None:
    results = json.dumps(study.to_dict(), allow_nan=False, ensure_ascii=False)
    (folder / RESULTS).write_text(results, encoding="utf-8")
    (folder / "report.txt").write_text(to_text(study.document), encoding="utf-8")
    (folder / "report.html").write_text(to_html(study.document), encoding="utf-8")
