"""What a study file may say about gains, and the stage that tunes them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flightid.control.autopilots import axis_loop_of
from flightid.control.autopilots.axis_loop import Gyro
from flightid.control.tuning.requirements import OBJECTIVES, TuningRequirements
from flightid.control.tuning.result import Tuning
from flightid.control.tuning.tune import tune
from flightid.control.tuning.tune_pid import CHANNELS, DRAWS
from flightid.errors import StudyError
from flightid.models import Model, load_model
from flightid.study.reading import TableReader
from flightid.validation import Comparison, Verification

if TYPE_CHECKING:
    from flightid.logs import Log
    from flightid.study.identified import Identified


@dataclass(frozen=True)
class TuneSettings:
    """How gains are tuned; see `flightid.tune`.

    Attributes
    ----------
    requirements : TuningRequirements
    gyro : {"filtered", "raw"}
        Which rate the models end at.
    angle_loop : bool
    draws, seed : int
    """

    requirements: TuningRequirements = field(default_factory=TuningRequirements)
    gyro: Gyro = "filtered"
    angle_loop: bool = True
    draws: int = DRAWS
    seed: int = 0


def read_tune(reader: TableReader) -> TuneSettings:
    """Read the table ``[tune]``.

    Raises
    ------
    StudyError
        A key is unknown, or a value does not fit.
    OptionError
        Requirements that contradict each other.
    """
    usual, given = TuneSettings(), {}
    for each in fields(TuningRequirements):
        if each.name != "objective":
            given[each.name] = reader.maybe(reader.positive, each.name)
    asked: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    asked["objective"] = reader.choice("objective", OBJECTIVES, usual.requirements.objective)
    gyro = reader.choice("gyro", ("filtered", "raw"), usual.gyro)
    made = TuneSettings(
        TuningRequirements(**asked),
        "raw" if gyro == "raw" else "filtered",
        reader.flag("angle_loop", usual.angle_loop),
        reader.integer("draws", usual.draws, minimum=1),
        reader.integer("seed", usual.seed),
    )
    reader.finish()
    return made


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
    identified: Iterable[Identified], log: Log | None, settings: TuneSettings
) -> Tuning | None:
    """Tune every axis whose rate a model of the study predicts from its command.

    Parameters
    ----------
    identified : iterable of Identified
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
        gyro=settings.gyro,
        angle_loop=settings.angle_loop,
        verifications=checks,
        draws=settings.draws,
        seed=settings.seed,
    )
