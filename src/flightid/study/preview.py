"""One stage of a study alone: the responses of a model, as the whole run would estimate them."""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping
from pathlib import Path
from typing import Any

from flightid.frozen import dataclass
from flightid.responses import FrequencyResponse
from flightid.study.model_settings import ModelSettings
from flightid.study.pipeline import Records, responses_of
from flightid.study.previewed import PreviewedStudy
from flightid.study.stage_runner import StageRunner
from flightid.study.stages import estimate
from flightid.study.taking import take
from flightid.study.task import Task
from flightid.surface import as_key, speaking


@dataclass(frozen=True, eq=False)
class ResponsePreview:
    """Responses of one model of a study.

    Attributes
    ----------
    settings : ModelSettings
        What the study says of the model.
    responses : mapping of str to FrequencyResponse
        By estimator, the one that counts first; those of `flightid run` to the last digit, but
        where the run lengthens automatic windows for a light mode that its fit has found.
    around : FrequencyResponse or None
        The first estimator over all frequencies that the records allow, without covariance.
    """

    settings: ModelSettings
    responses: Mapping[str, FrequencyResponse]
    around: FrequencyResponse | None = None


def preview_responses(
    path: str | Path,
    model: str,
    *,
    around: bool = False,
    cache: MutableMapping[str, Any] | None = None,
) -> ResponsePreview:
    """Estimate the responses of one model of a study file, and do nothing else of it.

    Parameters
    ----------
    path : str or Path
        Study file of a log or of records.
    model : str
        Name of one of its models.
    around : bool
        Estimate beyond the model's band as well.
    cache : mutable mapping of str to object, optional
        As in `run_study`: what has not changed since is not done again.

    Raises
    ------
    StudyError
        The study cannot be carried out as written, or would have to fly first.
    UnknownNameError
        It has no such model.
    FlightidError
        A stage refuses its data.
    """
    with speaking(as_key):
        study, runner = PreviewedStudy.of(path), StageRunner(cache)
        task, tasks = study.task(model), study.tasks()
        records = take(study.settings, tasks, None, study.folder, runner, inspects=False).records
        made = responses_of(task, records, runner)
        wide = _around(task, records, runner) if around and made else None
        return ResponsePreview(task.settings, {n: each.value for n, each in made.items()}, wide)


def _around(task: Task, records: Records, runner: StageRunner) -> FrequencyResponse:
    """The estimate that counts, over the band that its windows allow."""
    asked, settings = task.settings.response, task.settings
    return runner.stage(
        f"response: {settings.name}, everywhere",
        estimate,
        [records[name] for name in settings.flown],
        asked.moved(task.inputs),
        settings.outputs or task.outputs,
        None,
        asked.estimators[0],
        asked.of_estimates,
    ).value
