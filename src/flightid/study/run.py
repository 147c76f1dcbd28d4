"""The verb: a study file carried out from end to end."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

from flightid.errors import StudyError
from flightid.files import sha256_of_file
from flightid.inspection import inspect_log
from flightid.logs import read_log
from flightid.progress import progress
from flightid.record import Record
from flightid.report.html import to_html
from flightid.report.text import to_text
from flightid.simulation import write_ardupilot_log
from flightid.study.output import RESULTS, require_replaceable, whole_folder
from flightid.study.settings import Settings, read_settings
from flightid.study.stages import Identified, Task, check, cut_records, estimate, fit, load_task
from flightid.study.study import Study
from flightid.study.truth import Truth

FLIGHT_LOG = "flight.bin"


def run_study(
    path: str | Path, *, output: str | Path | None = None, log: str | Path | None = None
) -> Study:
    """Carry out a study file: log, records, responses, models, verification, report.

    The output folder appears whole or not at all.

    Parameters
    ----------
    path : str or Path
        Study file; docs/study.md describes it.
    output : str or Path, optional
        Folder to write; default: ``<study>-output`` beside the study file.
    log : str or Path, optional
        Log to read instead of the one that the study names.

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
    # Reading and cutting, three steps for each model, writing; a flight before all of it.
    steps = 3 + 3 * len(tasks)
    with whole_folder(final) as folder, progress(steps, source.stem) as advance:
        flown, truth = _obtain_log(settings, None if log is None else Path(log), folder)
        advance()
        opened = read_log(flown)
        inspection = inspect_log(opened)
        records = cut_records(opened, settings, tasks)
        advance()
        identified = tuple(_identify(task, records, settings, advance) for task in tasks)
        files = {item.name: sha256_of_file(item) for item in (source, flown)}
        study = Study(settings, final, inspection, records, identified, truth, files)
        _write(study, folder)
        advance()
    return study


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
