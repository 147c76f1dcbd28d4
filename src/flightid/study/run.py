"""The verb: a study file carried out from end to end."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from flightid.control.tuning.result import Tuning
from flightid.export.gains import write_gains
from flightid.files import sha256_of_file
from flightid.inspection import Inspection
from flightid.logs import Log
from flightid.progress import progress
from flightid.report.html import to_html
from flightid.report.text import to_text
from flightid.responses.windows.kept_bases import bases_kept
from flightid.review import FlightReview, review_flight
from flightid.study.error_list import ErrorList
from flightid.study.faults import TUNING, Faults
from flightid.study.flight import fly_again
from flightid.study.other_axes import with_other_axes
from flightid.study.output import (
    RESULTS,
    output_folder,
    require_replaceable,
    whole_folder,
)
from flightid.study.pipeline import identify_models
from flightid.study.qualities import rate_models, require_pairs
from flightid.study.record_files import require_files
from flightid.study.settings import read_settings
from flightid.study.stage_runner import StageResult, StageRunner
from flightid.study.study import Study
from flightid.study.taking import require_log, take
from flightid.study.task import load_task
from flightid.study.tuning import TuneSettings, tune_models
from flightid.study.uses import use_models
from flightid.study.views import view_log
from flightid.surface import as_key, speaking
from flightid.threads import on_one_thread
from flightid.uncertainty.quantiles import checked_level
from flightid.vehicles import GainFlight


def _tuning(of_study: TuneSettings | None, asked: bool | Mapping[str, Any]) -> TuneSettings | None:
    """What the study says of gains, else the usual, changed by what was asked for."""
    if asked is False:
        return of_study
    found = of_study or TuneSettings()
    return found.changed(asked) if isinstance(asked, Mapping) else found


@on_one_thread
def run_study(
    path: str | Path,
    *,
    output: str | Path | None = None,
    log: str | Path | None = None,
    tune: bool | Mapping[str, Any] = False,
    level: float | None = None,
    cache: MutableMapping[str, Any] | None = None,
    gains_file: str = "",
) -> Study:
    """Carry out a study file: log or records, responses, models, verification, report.

    The output folder appears whole or not at all; in one of an earlier run, files that no run wrote
    or that were changed since stay. What fails after the fits costs itself alone:
    the report names it in red, and all that was found stands.

    Parameters
    ----------
    path : str or Path
        Study file; docs/study.md describes it.
    output : str or Path, optional
        Folder to write; default: ``<study>-output`` beside the study file, of ``dryer-study.toml``
        ``dryer-output``.
    log : str or Path, optional
        Log to read instead of the one that the study names.
    tune : bool or mapping
        Tune gains with the usual requirements where the study does not say any; a mapping by the
        names of `TuningRequirements` and `TuneOptions` goes before what the study says.
    level : float, optional
        Of the intervals that the report shows, in place of the study's; verdicts keep 95 %.
    cache : mutable mapping of str to object, optional
        Results of stages by the hash of all that they depend on. Whoever gives the same mapping
        to the next run pays only for the stages behind what has changed.
    gains_file : str
        Parameter file to which the gains are to be written after the run, as the report shall name
        it; default: the usual name.

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
    with speaking(as_key):
        return _run(Path(path), output, log, tune, cache, level, gains_file)


def _run(
    source: Path,
    output: str | Path | None,
    log: str | Path | None,
    tune: bool | Mapping[str, Any],
    cache: MutableMapping[str, Any] | None,
    level: float | None,
    gains_file: str,
) -> Study:
    settings = read_settings(source)
    if level is not None:
        settings = replace(settings, level=checked_level(level))
    final = Path(output) if output is not None else output_folder(source)
    given = () if log is None else (Path(log),)
    require_replaceable(final, (source, *named_paths(settings), *given))
    collected = ErrorList()
    collected.read(require_files, None, settings.record_files if log is None else (), source)
    if log is None and settings.log is not None:
        collected.read(require_log, None, settings.log, source)
    tasks = list(collected.each(settings.models, load_task, [m.name for m in settings.models]))
    collected.finish()
    rated = settings.qualities
    if rated is not None:
        require_pairs(tasks, rated)
    runner = StageRunner(cache)
    # Reading and cutting, three steps for each model, writing; a flight before all of it.
    steps = 3 + 3 * len(tasks)
    with whole_folder(final) as folder, progress(steps, settings.title) as advance, bases_kept():
        taken = take(settings, tasks, None if log is None else Path(log), folder, runner)
        advance(2)
        staged = identify_models(
            tasks, taken.records, taken.inspection, settings.reduce, runner, advance
        )
        wanted = _tuning(settings.tune, tune)
        files = {item.name: sha256_of_file(item) for item in (source, *taken.files)}
        faults = Faults()
        tuned = None
        if wanted is not None:
            inputs = (runner, staged, taken.log, wanted, settings.record_files)
            tuned = faults.spare(TUNING, _tuned, None, *inputs)
        tuning = None if tuned is None else with_other_axes(tuned, taken.inspection, staged)
        flown = None
        if settings.flight is not None and settings.fly is not None and tuning is not None:
            asked = (tuned, settings.flight, settings.fly)
            flown = faults.spare("the flight with new gains", _flown, None, runner, *asked)
        if tuning is not None and tuning.plain and tuning.sound:
            faults.spare("the controller file", _write_gains, None, tuning, folder)
        uses = use_models(staged, settings.uses, folder, faults, runner)
        qualities = {}
        if rated is not None:
            qualities = rate_models(staged, uses.loops, rated, faults, runner)
        seen = (taken.log, taken.inspection)
        reviewed = faults.spare("the flight review", _reviewed, None, runner, *seen)
        tried, plots, plan = view_log(settings.views, taken.log, runner, faults, folder)
        study = Study(
            settings,
            final,
            None if taken.inspection is None else taken.inspection.value,
            {str(each.name): each for group in taken.records.values() for each in group.value},
            tuple(each.value for each in staged),
            taken.truth,
            files,
            tuning,
            flown,
            qualities,
            uses,
            tuple(faults.findings),
            taken.checks,
            tuple(runner.carried_out),
            tuple(runner.from_cache),
            source,
            reviewed,
            tried,
            plots,
            plan,
            gains_file,
        )
        _write(study, folder)
        advance()
    return study


def _tuned(runner: StageRunner, *inputs: object) -> StageResult[Tuning | None]:
    """Gains, as a stage."""
    return runner.stage("tuning", tune_models, *inputs)


def _reviewed(
    runner: StageRunner, log: StageResult[Log] | None, *inspected: object
) -> FlightReview | None:
    """What the flight tells besides, as a stage; None without a log."""
    return None if log is None else runner.stage("flight review", _review, log, *inspected).value


def _review(log: Log, inspection: Inspection | None) -> FlightReview:
    return review_flight(log, inspection=inspection)


def _flown(runner: StageRunner, *inputs: object) -> GainFlight:
    """The flight with new gains, as a stage."""
    return runner.stage("the flight with new gains", fly_again, *inputs).value


def _write_gains(tuning: Tuning, folder: Path) -> None:
    """Gains of controllers of their own, beside the models: numbers, and code where it runs."""
    write_gains(tuning, folder / "controller.toml")
    if all(design.plain and design.plain.sampled for design in tuning.sound):
        write_gains(tuning, folder / "controller.c")


def named_paths(settings: object) -> Iterator[Path]:
    """Every path that the settings of a study name."""
    if isinstance(settings, Path):
        yield settings
    elif isinstance(settings, str):
        yield from [Path(settings)] if settings.endswith(".toml") else []
    elif isinstance(settings, Mapping):
        yield from (path for value in settings.values() for path in named_paths(value))
    elif isinstance(settings, tuple | list):
        yield from (path for value in settings for path in named_paths(value))
    elif is_dataclass(settings) and not isinstance(settings, type):
        named = (getattr(settings, field.name) for field in fields(settings))
        yield from (path for value in named for path in named_paths(value))


def _write(study: Study, folder: Path) -> None:
    results = json.dumps(study.to_dict(), allow_nan=False, ensure_ascii=False)
    (folder / RESULTS).write_text(results, encoding="utf-8")
    (folder / "report.txt").write_text(to_text(study.document), encoding="utf-8")
    (folder / "report.html").write_text(to_html(study.document), encoding="utf-8")
