"""The stages of a study up to its gains, as the whole run would carry them out."""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from flightid.control.tuning.controller_options import ControllerOptions
from flightid.control.tuning.result import Tuning
from flightid.frozen import dataclass
from flightid.models import Model
from flightid.models.model import model_of
from flightid.study.actuator_range import input_ranges
from flightid.study.pipeline import identify_models
from flightid.study.previewed import PreviewedStudy
from flightid.study.stage_runner import StageRunner
from flightid.study.taking import take
from flightid.study.tuning import TuneSettings, only_loop, tune_by_hand, tune_models
from flightid.surface import as_key, speaking


def preview_tuning(
    path: str | Path, *, cache: MutableMapping[str, Any] | None = None
) -> Tuning | None:
    """Tune the gains of a study file, and write nothing: those of ``flightid tune`` of that file.

    Parameters
    ----------
    path : str or Path
        Study file of a log or of records; without ``[tune]`` as usual.
    cache : mutable mapping of str to object, optional
        As in `run_study`: what has not changed since is not done again.

    Returns
    -------
    Tuning or None
        None where no model is of a rate to its command.

    Raises
    ------
    StudyError
        The study cannot be carried out as written, or would have to fly first.
    FlightidError
        A stage refuses its data.
    """
    with speaking(as_key):
        settings, runner, log, staged = _identified(Path(path), cache)
        wanted, files = settings.tune or TuneSettings(), settings.record_files
        if log is None and wanted.controller is None:
            wanted = replace(wanted, controller=ControllerOptions())  # as `flightid tune` does
        if wanted.controller is None and wanted.options.by_hand and not wanted.has_other_filters:
            alone = replace(wanted, options=replace(wanted.options, by_hand=None))
            found = runner.stage("tuning", tune_models, staged, log, alone, files)
            if found.value is not None:
                inputs = (staged, log, wanted, found)
                held: Tuning = runner.stage("gains by hand", tune_by_hand, *inputs).value
                return held
        made = runner.stage("tuning", tune_models, staged, log, wanted, files)
        tuned: Tuning | None = made.value
        return tuned


@dataclass(frozen=True)
class LoopChoice:
    """Loops that models of records have, each as output/input.

    Attributes
    ----------
    offered, chosen : tuple of str
        All of them; those that a tuning closes, none where it must be told.
    ranges : mapping of str to tuple of float
        What each input went through in the records: a proposal for the limits of an actuator.
    """

    offered: tuple[str, ...]
    chosen: tuple[str, ...]
    ranges: Mapping[str, tuple[float, float]]


def preview_loops(
    path: str | Path, *, cache: MutableMapping[str, Any] | None = None
) -> LoopChoice | None:
    """Loops around which a study of records may close a PID of its own; None where it reads a log.

    Parameters
    ----------
    path : str or Path
    cache : mutable mapping of str to object, optional
        As in `run_study`.

    Raises
    ------
    StudyError
        The study cannot be carried out as written.
    FlightidError
        A stage refuses its data.
    """
    with speaking(as_key):
        settings, runner, log, staged = _identified(Path(path), cache)
        asked = None if settings.tune is None else settings.tune.controller
        if log is not None and asked is None:
            return None
        fits = (each.value.fit for each in staged if each.value.fit is not None)
        models = [cast(Model, model_of(each)) for each in fits]
        offered = [f"{y}/{u}" for each in models for y in each.outputs for u in each.inputs]
        single = [each for model in models for each in only_loop(model)]
        chosen = asked.loops if asked is not None and asked.loops else tuple(single)
        files = settings.record_files
        ranges = runner.stage("ranges of inputs", input_ranges, staged, files).value
        return LoopChoice(tuple(dict.fromkeys(offered)), chosen, ranges)


def preview_fits(path: str | Path, *, cache: MutableMapping[str, Any] | None = None) -> list[Any]:
    """Fits of a study file, as the whole run would make them.

    Parameters
    ----------
    path : str or Path
        Study file of a log or of records.
    cache : mutable mapping of str to object, optional
        As in `run_study`.

    Raises
    ------
    StudyError
        The study cannot be carried out as written, or would have to fly first.
    FlightidError
        A stage refuses its data.
    """
    with speaking(as_key):
        *_, staged = _identified(Path(path), cache)
        return [each.value.fit for each in staged if each.value.fit is not None]


def _identified(path: Path, cache: MutableMapping[str, Any] | None) -> tuple[Any, ...]:
    """Settings, what carries stages out, the log, and all models."""
    study, runner = PreviewedStudy.of(path), StageRunner(cache)
    settings, tasks = study.settings, study.tasks()
    taken = take(settings, tasks, None, study.folder, runner)
    staged = identify_models(
        tasks, taken.records, taken.inspection, settings.reduce, runner, lambda *_: None
    )
    return settings, runner, taken.log, staged
