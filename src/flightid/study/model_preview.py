"""One model of a study without its fit: its equations, and the data that a prediction meets."""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping
from pathlib import Path
from typing import Any

from flightid.frozen import dataclass
from flightid.models import GreyBoxModel
from flightid.record import Record
from flightid.responses import FrequencyResponse
from flightid.study.model_settings import ModelSettings
from flightid.study.pipeline import responses_of
from flightid.study.previewed import PreviewedStudy
from flightid.study.stage_runner import StageRunner
from flightid.study.taking import take
from flightid.study.task import Task
from flightid.surface import as_key, speaking


@dataclass(frozen=True, eq=False)
class ModelPreview:
    """A model of a study before its fit.

    Attributes
    ----------
    settings : ModelSettings
        What the study says of it.
    model : TransferFunctionModel, StateSpaceModel or None
        Equations and start values, overrides applied; None for a structure without equations.
    response : FrequencyResponse or None
        The one that counts, where the fit takes responses.
    records : mapping of str to list of Record
        Those of ``verify``, by name; where there are none, those of the fit.
    """

    settings: ModelSettings
    model: GreyBoxModel | None
    response: FrequencyResponse | None = None
    records: Mapping[str, list[Record]] | None = None


def preview_model(
    path: str | Path,
    model: str,
    *,
    data: bool = False,
    cache: MutableMapping[str, Any] | None = None,
) -> ModelPreview:
    """Load one model of a study file, with the data of its predictions where they are asked for.

    Parameters
    ----------
    path : str or Path
        Study file of a log or of records.
    model : str
        Name of one of its models.
    data : bool
        Read the records and estimate the response as well.
    cache : mutable mapping of str to object, optional
        As in `run_study`: what has not changed since is not done again.

    Raises
    ------
    StudyError
        The study cannot be carried out as written, or would have to fly first.
    UnknownNameError
        It has no such model, or its template no such parameter.
    ModelError
        A value lies outside its bounds, or a tie is wrong.
    """
    with speaking(as_key):
        study = PreviewedStudy.of(path)
        task = study.task(model)
        if not data:
            return ModelPreview(task.settings, task.model)
        return _with_data(study, task, StageRunner(cache))


def _with_data(study: PreviewedStudy, task: Task, runner: StageRunner) -> ModelPreview:
    tasks = study.tasks()
    records = take(study.settings, tasks, None, study.folder, runner, inspects=False).records
    made = responses_of(task, records, runner)
    wanted = task.settings.verify or task.settings.identify
    return ModelPreview(
        task.settings,
        task.model,
        next(iter(made.values())).value if made else None,
        {name: records[name].value for name in wanted},
    )
