"""What a study file may say about gains, and the stage that tunes them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from flightid.control.tuning.controller_options import ControllerOptions
from flightid.control.tuning.flown_gains import loops_of, require_known
from flightid.control.tuning.options import TuneOptions
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.result import RefusedAxis, Tuning
from flightid.control.tuning.tune import tune
from flightid.control.tuning.tune_controller import tune_controller
from flightid.control.tuning.tune_pid import CHANNELS
from flightid.control.tuning.tuned_filters import TunedFilters
from flightid.conventions import Light
from flightid.errors import DataError, FlightidError, ModelError, OptionError, StudyError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.models import Model, NarxModel, load_model
from flightid.models.model import model_of
from flightid.options import options_of
from flightid.review.suggested_filters import suggested_filters
from flightid.study.actuator_range import input_ranges, untold_limits
from flightid.study.other_axes import untouched_axes
from flightid.study.reading import TableReader, read_each
from flightid.study.record_files import RecordFile
from flightid.validation import Comparison, Verification

if TYPE_CHECKING:
    from flightid.logs import Log
    from flightid.study.identified import ModelResults


KINDS = (TuningRequirements, TuneOptions, ControllerOptions)
"""Dataclasses whose options are the keys of [tune], and options of ``flightid tune``."""
AUTOPILOT_ONLY = ("gyro", "angle_loop", "signs", "other_loops", "filters")
"""Options that a PID of its own does not know."""


@dataclass(frozen=True)
class TuneSettings:
    """How gains are tuned; see `flightid.tune`.

    Attributes
    ----------
    requirements : TuningRequirements
    options : TuneOptions
    controller : ControllerOptions or None
        A PID of its own in place of an autopilot; None where none of its options is given.
    """

    requirements: TuningRequirements = field(default_factory=TuningRequirements)
    options: TuneOptions = field(default_factory=TuneOptions)
    controller: ControllerOptions | None = None

    @property
    def has_other_filters(self) -> bool:
        """Whether gains are tuned with filters that did not fly, which all axes share."""
        return self.options.filters != "flown"

    def changed(self, given: Mapping[str, Any]) -> TuneSettings:
        """With some requirements and options replaced, by name.

        Raises
        ------
        OptionError
            A value outside its range, or requirements that contradict each other.
        """
        told: list[dict[str, Any]] = [
            {name: given[name] for name in given if name in {o.name for o in options_of(kind)}}
            for kind in KINDS
        ]
        own = self.controller
        if told[2]:
            own = replace(own or ControllerOptions(), **told[2])
        return TuneSettings(
            self.requirements.changed(**told[0]), replace(self.options, **told[1]), own
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
    asked = any(each.name in reader for each in options_of(ControllerOptions))
    requirements, options, controller = read_each(KINDS, reader)
    return TuneSettings(requirements, options, controller if asked else None)


def tune_files(
    files: Iterable[str | Path], log: Log | None, settings: TuneSettings
) -> Tuning | None:
    """Tune the axes of model files, as `run_study` and ``flightid identify --write`` leave them.

    Parameters
    ----------
    files : iterable of str or Path
        The first model of an axis counts; its covariance and evidence are in the file.
    log : Log or None
        The flight, which holds the gains that flew; a PID of its own needs none.
    settings : TuneSettings

    Returns
    -------
    Tuning or None
        None where no model is of a rate to its command.
    """
    return tune_loaded(map(load_model, files), log, settings)


def tune_loaded(models: Iterable[Model], log: Log | None, settings: TuneSettings) -> Tuning | None:
    """Tune the axes of models as `tune_files` does.

    Parameters
    ----------
    models : iterable of model
        The first of an axis counts.
    log : Log or None
        The flight, which holds the gains that flew; a PID of its own needs none.
    settings : TuneSettings

    Returns
    -------
    Tuning or None
        None where no model is of a rate to its command.
    """
    first: dict[str, object] = {}
    loaded = list(models)
    if settings.controller is not None:
        return _controllers([(model, ()) for model in loaded], settings.controller, settings)
    for model in loaded:
        for axis in _axes(model):
            first.setdefault(axis, model)
    return _tuned(first, _flight(log), settings, {}) if first else None


def _axes(model: Model) -> list[str]:
    """Axes whose rate a model predicts from its command."""
    return [
        axis
        for axis, (command, rate) in CHANNELS.items()
        if command in model.inputs and rate in model.outputs
    ]


def tune_models(
    identified: Iterable[ModelResults],
    log: Log | None,
    settings: TuneSettings,
    files: Sequence[RecordFile] = (),
) -> Tuning | None:
    """Tune every axis whose rate a model of the study predicts from its command.

    Parameters
    ----------
    identified : iterable of ModelResults
    log : Log or None
        The flight, which holds the gains that flew.
    settings : TuneSettings
    files : sequence of RecordFile
        What the records were read from, where there is no log.

    Returns
    -------
    Tuning or None
        None where no model is of a rate to its command.

    Raises
    ------
    StudyError
        The study reads records, which hold no gains.
    """
    if settings.controller is not None:
        items = [one for one in identified if one.fit]
        known = [(one.fit, tuple(one.verifications.values())) for one in items]
        return _controllers(known, settings.controller, settings, input_ranges(items, files))
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
    return _tuned(fits, _flight(log), settings, checks)


def tune_by_hand(
    identified: Iterable[ModelResults], log: Log | None, settings: TuneSettings, searched: Tuning
) -> Tuning:
    """The gains of a study with some by hand, where those of the search are known.

    Axes that share no model with a gain by hand are those of the search; so are those of
    `tune_models` with these settings, which searches them once more.

    Parameters
    ----------
    identified : iterable of ModelResults
    log : Log or None
    settings : TuneSettings
        With gains by hand and flown filters.
    searched : Tuning
        The same without gains by hand.
    """
    flight = _flight(log)
    by_hand = settings.options.by_hand or {}
    loops = {each.axis: each for each in loops_of(flight, "", CHANNELS)}
    touched: list[ModelResults] = []
    for item in identified:
        axes = [] if item.fit is None else _axes(item.fit.model)
        own = {name for axis in axes if axis in loops for name in loops[axis].names.values()}
        if own & by_hand.keys():
            touched.append(item)
    require_known(by_hand, list(loops.values()))
    made = tune_models(touched, log, settings) if touched else None
    if made is None:
        return searched
    new = {each.axis: each for each in made.designs}
    anew = {*new, *(each.axis for each in made.refused)}
    return replace(
        searched,
        designs=tuple(new.get(each.axis, each) for each in searched.designs),
        together=(
            *(each for each in searched.together if not anew & {*each.axes}),
            *made.together,
        ),
    )


def _flight(log: Log | None) -> Log:
    """The flight, which holds the gains that flew."""
    if log is not None:
        return log
    raise StudyError(
        "gains of an autopilot cannot be tuned without the log that it flew",
        needed="a log, or a controller that is no autopilot's",
        action="name a PID of its own: flightid tune STUDY --controller pi_d",
    )


def _controllers(
    known: Sequence[tuple[Any, tuple[Verification | Comparison, ...]]],
    controller: ControllerOptions,
    settings: TuneSettings,
    ranges: Mapping[str, tuple[float, float]] | None = None,
) -> Tuning | None:
    """A PID of its own around each loop that is asked for, of the first model that has it."""
    if not known:
        raise StudyError(
            "no model was made, so no gains are made",
            needed="a fitted model",
            action="read why each model was left out, and record again as that says",
        )
    designs: dict[str, PidDesign] = {}
    errors: dict[str, FlightidError] = {}
    models = [model_of(model) for model, _ in known]
    nonlinear = {each.output for each in models if isinstance(each, NarxModel)}
    # Of a nonlinear model there are no gains; the linear one beside it may have some.
    for model, checks in sorted(known, key=lambda each: isinstance(model_of(each[0]), NarxModel)):
        channels = cast(Model, model_of(model))
        for name in controller.loops or only_loop(channels):
            output, input = _loop_channels(name)
            if (
                name in designs
                or name in errors
                or output not in channels.outputs
                or input not in channels.inputs
            ):
                continue
            asked = {k: v for k, v in vars(settings.options).items() if k not in AUTOPILOT_ONLY}
            asked["by_hand"] = _own_gains(asked["by_hand"] or {}, output)
            try:
                made = tune_controller(
                    model, inputs=input, outputs=output, controller=controller,
                    requirements=settings.requirements, verification=checks, **asked,
                )  # fmt: skip
                told = untold_limits(controller, input, channels, ranges or {})
                told = (*told, *([_beside_nonlinear(output)] if output in nonlinear else []))
                designs[name] = replace(made, findings=(*made.findings, *told))
            except (DataError, ModelError) as error:
                errors[name] = error
    _require_loops(settings.options.by_hand or {}, [*designs, *errors])
    missing = [name for name in controller.loops if name not in {*designs, *errors}]
    if errors and not designs:
        raise next(iter(errors.values()))
    if not designs and (untold := _without_errors([fit for fit, _ in known])) is not None:
        raise untold
    if missing or not designs:
        raise StudyError(
            "no model has the loop that is to be closed",
            found=", ".join(missing) or "models with several inputs or outputs, and no loops named",
            needed="loops as output/input of fitted models",
            action=f"name one: --loops {_first_loop(known)}",
        )
    refused = tuple(RefusedAxis.by(name, error) for name, error in errors.items())
    return Tuning(tuple(designs.values()), (), refused)


def _beside_nonlinear(output: str) -> Finding:
    """What gains of a linear model hold for where a nonlinear one runs better."""
    said = (
        f"a NARX model of {output} runs better than the linear one that gains rest on: margins "
        "hold at the levels of its record, and the plant has others elsewhere"
    )
    action = "try the gains at the largest and least levels, or tune by steps about each"
    return Finding("nonlinear-beside", Light.AMBER, said, action)


def _own_gains(by_hand: Mapping[str, float], output: str) -> dict[str, float]:
    """Those of one loop: named by the gain alone, or by output/gain where several are closed."""
    parted = {name.rpartition("/"): value for name, value in by_hand.items()}
    return {gain: v for (loop, _, gain), v in parted.items() if loop in ("", output)}


def _require_loops(by_hand: Mapping[str, float], closed: Sequence[str]) -> None:
    """Refuse gains by hand of a loop that is not closed.

    Raises
    ------
    OptionError
        Names them.
    """
    outputs = [_loop_channels(name)[0] for name in closed]
    lost = [name for name in by_hand if name.rpartition("/")[0] not in ("", *outputs)]
    if closed and lost:
        raise OptionError(
            "by_hand names gains of a loop that is not closed",
            found=", ".join(lost),
            needed=f"Kp, Ki, Kd, or with the output before them: {outputs[0]}/Kp",
        )


def _without_errors(fits: Sequence[Any]) -> StudyError | None:
    """That no fit knows its errors: no loop that one could name would have gains."""
    if any(getattr(fit, "covariance", fit) is not None for fit in fits):
        return None
    why = [each for fit in fits if (each := fit.evidence.reason) is not None]
    return StudyError(
        "gains for models whose errors are not known would promise nothing",
        found="; ".join(dict.fromkeys(each.message for each in why)),
        needed="a fit with a covariance",
        action=why[0].action if why else "",
    )


def _first_loop(known: Sequence[tuple[Any, object]]) -> str:
    """A loop worth closing: of a model whose errors are known, where there is one."""
    told = (each for each, _ in known if getattr(each, "covariance", None) is not None)
    model = cast(Model, model_of(next(told, known[0][0])))
    return f"{model.outputs[0]}/{model.inputs[0]}"


def only_loop(model: Model) -> tuple[str, ...]:
    """The loop of a model with one input and one output."""
    if len(model.inputs) == len(model.outputs) == 1:
        return (f"{model.outputs[0]}/{model.inputs[0]}",)
    return ()


def _loop_channels(name: str) -> tuple[str, str]:
    output, slash, input = name.partition("/")
    if not (output and slash and input):
        raise StudyError("a loop has no such name", found=name, needed="output/input")
    return output, input


def _tuned(
    fits: Mapping[str, object],
    log: Log,
    settings: TuneSettings,
    checks: Mapping[str, Iterable[Verification | Comparison]],
) -> Tuning:
    asked = {name: value for name, value in vars(settings.options).items() if name != "filters"}
    choice, reason = None, ""
    if settings.options.filters == "suggested":
        choice, reason = suggested_filters(log, fits)
    made = tune(
        fits,
        gains=log,
        requirements=settings.requirements,
        verifications=checks,
        filters=choice,
        **asked,
    )
    made = replace(made, untouched=untouched_axes(log, fits))
    return replace(made, filters=TunedFilters(reason=reason)) if reason else made
