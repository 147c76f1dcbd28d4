"""What a study file may say about gains, and the stage that tunes them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flightid.control.autopilots import axis_loop_of
from flightid.control.tuning.options import TuneOptions
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.result import Tuning
from flightid.control.tuning.tune import tune
from flightid.control.tuning.tune_pid import CHANNELS
from flightid.errors import StudyError
from flightid.models import Model, load_model
from flightid.options import options_of
from flightid.study.reading import TableReader, read_each
from flightid.validation import Comparison, Verification

if TYPE_CHECKING:
    from flightid.logs import Log
    from flightid.study.identified import ModelResults


@dataclass(frozen=True)
class TuneSettings:
    """How gains are tuned; see `flightid.tune`.

    Attributes
    ----------
    requirements : TuningRequirements
    options : TuneOptions
    """

    requirements: TuningRequirements = field(default_factory=TuningRequirements)
    options: TuneOptions = field(default_factory=TuneOptions)

    def changed(self, given: Mapping[str, Any]) -> TuneSettings:
        """With some requirements and options replaced, by name.

        Raises
        ------
        OptionError
            A value outside its range, or requirements that contradict each other.
        """
        mine = {each.name for each in options_of(TuneOptions)}
        return TuneSettings(
            replace(self.requirements, **{k: v for k, v in given.items() if k not in mine}),
            replace(self.options, **{k: v for k, v in given.items() if k in mine}),
        )


def read_tune(reader: TableReader) -> TuneSettings:
    """Read the table ``[tune]``.

    Raises
    ------
    StudyError
        A key is unknown, or a value does not fit.
    OptionError
        Requirements that contradict each other.
    """
    made = read_each((TuningRequirements, TuneOptions), reader)
    return TuneSettings(*made)


def tune_files(files: Iterable[str | Path], log: Log, settings: TuneSettings) -> Tuning | None:
    """Tune the axes of model files, as `run_study` and ``flightid identify --write`` leave them.

    Parameters
    ----------
    files : iterable of str or Path
        The first model of an axis counts; its covariance and evidence are in the file.
    log : Log
        The flight, which holds the gains that flew.
    settings : TuneSettings

    Returns
    -------
    Tuning or None
        None where no model is of a rate to its command.
    """
    models: dict[str, object] = {}
    for model in map(load_model, files):
        for axis in _axes(model):
            models.setdefault(axis, model)
    return _tuned(models, log, settings, {}) if models else None


def _axes(model: Model) -> list[str]:
    """Axes whose rate a model predicts from its command."""
    return [
        axis
        for axis, (command, rate) in CHANNELS.items()
        if command in model.inputs and rate in model.outputs
    ]


def tune_models(
    identified: Iterable[ModelResults], log: Log | None, settings: TuneSettings
) -> Tuning | None:
    """Tune every axis whose rate a model of the study predicts from its command.

    Parameters
    ----------
    identified : iterable of ModelResults
    log : Log or None
        The flight, which holds the gains that flew.
    settings : TuneSettings

    Returns
    -------
    Tuning or None
        None where no model is of a rate to its command.

    Raises
    ------
    StudyError
        The study reads records, which hold no gains.
    """
    fits: dict[str, object] = {}
    checks = {}
    for item in identified:
        if item.fit is None:
            continue
        for axis in _axes(item.fit.model):
            if axis not in fits:
                fits[axis] = item.fit
                checks[axis] = tuple(item.verifications.values())
    if not fits:
        return None
    if log is None:
        raise StudyError(
            "gains cannot be tuned from records alone",
            needed="a log, which holds the gains that flew",
            action="take [tune] out, or call flightid.tune with the gains",
        )
    return _tuned(fits, log, settings, checks)


def _tuned(
    fits: Mapping[str, object],
    log: Log,
    settings: TuneSettings,
    checks: Mapping[str, Iterable[Verification | Comparison]],
) -> Tuning:
    return tune(
        fits,
        gains={axis: axis_loop_of(log, axis) for axis in fits},
        requirements=settings.requirements,
        verifications=checks,
        **vars(settings.options),
    )
