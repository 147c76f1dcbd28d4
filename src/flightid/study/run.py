"""The verb: a study file carried out from end to end."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from flightid.files import sha256_of_file
from flightid.progress import progress
from flightid.report.html import to_html
from flightid.report.text import to_text
from flightid.study.black_box import identify_black_box
from flightid.study.evidence import examined
from flightid.study.output import RESULTS, require_replaceable, whole_folder
from flightid.study.qualities import rate_models, require_pairs
from flightid.study.settings import Settings, read_settings
from flightid.study.stages import (
    Identified,
    Task,
    check,
    choose_responses,
    estimate,
    examine_residuals,
    fit,
    load_task,
    start_from,
)
from flightid.study.study import Study
from flightid.study.taking import Taken, take
from flightid.study.tuning import TuneSettings, tune_models


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
    tasks = [load_task(model) for model in settings.models]
    rated = settings.qualities
    if rated is not None:
        require_pairs(tasks, rated)
    # Reading and cutting, three steps for each model, writing; a flight before all of it.
    steps = 3 + 3 * (len(tasks) + len(settings.black_boxes))
    with whole_folder(final) as folder, progress(steps, source.stem) as advance:
        taken = take(settings, tasks, None if log is None else Path(log), folder)
        advance(2)
        identified: tuple[Identified, ...] = ()
        for task in tasks:
            begun = start_from(task, identified)
            identified = (*identified, _identify(begun, taken, settings, advance))
        boxes = []
        for asked in settings.black_boxes:
            boxes.append(identify_black_box(asked, taken.records, taken.inspection))
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


def _identify(
    task: Task, taken: Taken, settings: Settings, advance: Callable[..., None]
) -> Identified:
    records = taken.records
    responses = estimate(task, records)
    task, coherent = choose_responses(task, responses)
    advance()
    fits, reduction = fit(task, responses, records, settings.reduce, coherent)
    advance()
    counts = next(iter(fits.values()))
    verifications = check(task, counts, records, next(iter(responses.values()), None))
    tests = examine_residuals(task, counts)
    found = [*(() if tests is None else tests.findings)]
    found += [finding for each in verifications.values() for finding in each.findings]
    first = next(iter(fits))
    fits = {**fits, first: examined(counts, taken.inspection, found)}
    advance()
    return Identified(
        task.settings,
        responses,
        fits,
        verifications,
        reduction,
        coherent,
        tests,
        task.reference,
    )


def _write(study: Study, folder: Path) -> None:
    results = json.dumps(study.to_dict(), allow_nan=False, ensure_ascii=False)
    (folder / RESULTS).write_text(results, encoding="utf-8")
    (folder / "report.txt").write_text(to_text(study.document), encoding="utf-8")
    (folder / "report.html").write_text(to_html(study.document), encoding="utf-8")
