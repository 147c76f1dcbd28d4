"""The stages of a study, one function each, from the log to the verified models."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from flightid.conventions import Role
from flightid.errors import StudyError
from flightid.findings import Finding
from flightid.identification import Fit, Reduction, identify, reduce
from flightid.logs import Log, SidRun
from flightid.models import GreyBoxModel, load_structure
from flightid.record import Record
from flightid.responses import FrequencyResponse, estimate_response
from flightid.study.record_files import load_record
from flightid.study.settings import ModelSettings, Segment, Settings
from flightid.validation import Comparison, Verification, verify

EXCITATION = "excitation"


@dataclass(frozen=True, eq=False)
class Task:
    """One model to identify, loaded.

    Attributes
    ----------
    settings : ModelSettings
        What was asked.
    model : TransferFunctionModel or StateSpaceModel
        Structure and start values, overrides applied.
    rivals : mapping of str to TransferFunctionModel or StateSpaceModel
        Models to verify side by side with the fit, by name.
    """

    settings: ModelSettings
    model: GreyBoxModel
    rivals: Mapping[str, GreyBoxModel] = field(default_factory=dict)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that the model names."""
        return (*self.model.inputs, *self.model.outputs)


@dataclass(frozen=True, eq=False)
class Identified:
    """What a study made of one model.

    Attributes
    ----------
    settings : ModelSettings
        What was asked.
    responses : mapping of str to FrequencyResponse
        By estimator; the first is the one that counts.
    fits : mapping of str to Fit
        By estimator.
    verifications : mapping of str to Verification or Comparison
        By segment, none of which the fit has seen; side by side where there are rivals.
    reduction : Reduction or None
        How the structure of the fits came about, where the study asks for a reduction.
    """

    settings: ModelSettings
    responses: Mapping[str, FrequencyResponse]
    fits: Mapping[str, Fit]
    verifications: Mapping[str, Verification | Comparison]
    reduction: Reduction | None = None

    @property
    def response(self) -> FrequencyResponse | None:
        """The response that was fitted; None where records were."""
        return next(iter(self.responses.values()), None)

    @property
    def fit(self) -> Fit:
        """The fit that counts."""
        return next(iter(self.fits.values()))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts on the response, the fit, its structure and each verification that count."""
        checks = (finding for each in self.verifications.values() for finding in each.findings)
        first = () if self.response is None else self.response.findings
        path = () if self.reduction is None else self.reduction.path_findings
        return (*first, *self.fit.findings, *path, *checks)

    def to_dict(self) -> dict[str, object]:
        """Plain values of every result."""
        return {
            "name": self.settings.name,
            "responses": {key: value.to_dict() for key, value in self.responses.items()},
            "fits": {key: value.to_dict() for key, value in self.fits.items()},
            "reduction": None if self.reduction is None else self.reduction.to_dict(),
            "verifications": {key: value.to_dict() for key, value in self.verifications.items()},
        }


def load_task(settings: ModelSettings, *, on_records: bool = False) -> Task:
    """Load a model and apply the overrides of the study.

    Raises
    ------
    StudyError
        The model has more than one response, which records alone can fit.
    UnknownNameError
        There is no such library model, or no such parameter in it.
    """
    path = settings.template_path
    model = load_structure(settings.template if path is None else path, axis=settings.axis)
    if len(model.responses) != 1 and not on_records:
        raise StudyError(
            f"model {settings.name!r} has several responses",
            found=", ".join(model.response_names),
            needed="one output to one input",
            action='fit it to the records: [identify] method = "output_error"',
        )
    parameters = model.parameters
    for name, given in settings.parameters.items():
        parameters = parameters.with_parameter(replace(parameters[name], **given))
    rivals = {
        name: load_structure(path if path.endswith(".toml") else name, axis=settings.axis)
        for name, path in settings.rivals.items()
    }
    return Task(settings, replace(model, parameters=parameters), rivals)


def channels_needed(settings: Settings, tasks: Iterable[Task]) -> dict[str, dict[str, Role]]:
    """Channels that the models take from each record, with their roles.

    Parameters
    ----------
    settings : Settings
        The study.
    tasks : iterable of Task
        Its models with equations.

    Returns
    -------
    dict of str to dict of str to Role
        By name of the segment or record.
    """
    users = [(task.settings.segments, task.model.inputs, task.model.outputs) for task in tasks]
    users += [(box.segments, box.inputs, (box.output,)) for box in settings.black_boxes]
    needed: dict[str, dict[str, Role]] = {}
    # Outputs last: what one model drives and another predicts is measured.
    for role, place in ((Role.INPUT, 1), (Role.OUTPUT, 2)):
        for user in users:
            for name in user[0]:
                needed.setdefault(name, {}).update(dict.fromkeys(user[place], role))
    return needed


def load_records(settings: Settings, needed: Mapping[str, Mapping[str, Role]]) -> dict[str, Record]:
    """Read every record file that a model uses.

    Raises
    ------
    StudyError
        A file is not there, or it is not clear which manoeuvre is meant.
    """
    return {
        file.name: load_record(file, needed[file.name])
        for file in settings.record_files
        if file.name in needed
    }


def cut_records(
    log: Log, settings: Settings, needed: Mapping[str, Mapping[str, Role]]
) -> dict[str, Record]:
    """Take every segment that a model uses out of the log, with the channels its models need.

    Parameters
    ----------
    log : Log
        The flight.
    settings : Settings
        The study.
    needed : mapping of str to mapping of str to Role
        Channels by segment, from `channels_needed`.

    Returns
    -------
    dict of str to Record
        By segment name.

    Raises
    ------
    StudyError
        The log holds no such system-identification run.
    """
    return {
        segment.name: _cut(log, segment, settings, needed[segment.name])
        for segment in settings.segments
        if segment.name in needed
    }


def _cut(log: Log, segment: Segment, settings: Settings, roles: Mapping[str, Role]) -> Record:
    return log.record(
        settings.channel_map,
        names=list(roles),
        span_s=segment.span_s,
        sid_run=None if segment.sid_axis is None else sid_run(log, segment),
        sample_rate_hz=settings.sample_rate_hz,
        roles=roles,
        gaps=settings.gaps,
        max_gap_s=settings.max_gap_s,
        name=segment.name,
    )


def sid_run(log: Log, segment: Segment) -> SidRun:
    """System-identification run that a segment names.

    Raises
    ------
    StudyError
        The log holds no such run.
    """
    runs = [run for run in log.sid_runs if run.axis == segment.sid_axis]
    if segment.run >= len(runs):
        flown = ", ".join(str(run.axis) for run in log.sid_runs) or "none"
        raise StudyError(
            f"segment {segment.name!r}: the log holds no such system-identification run",
            found=f"runs of SID_AXIS {flown}",
            needed=f"run {segment.run} of SID_AXIS {segment.sid_axis}",
        )
    return runs[segment.run]


def estimate(
    task: Task, records: Mapping[str, Record], settings: Settings
) -> dict[str, FrequencyResponse]:
    """Frequency responses of one model's segments by each estimator, the one that counts first."""
    chosen, band = settings.response, task.settings.band_rad_s
    if settings.on_records or band is None:
        return {}
    return {
        estimator: estimate_response(
            [records[name] for name in task.settings.identify],
            inputs=task.model.inputs,
            outputs=task.model.outputs,
            excitations=EXCITATION if estimator == "instrument" else None,
            band_rad_s=band,
            n_omega=chosen.n_omega,
            window_s=list(chosen.window_s) or "auto",
            estimator=estimator,
        )
        for estimator in dict.fromkeys((chosen.estimator, *chosen.compare))
    }


def fit(
    task: Task,
    responses: Mapping[str, FrequencyResponse],
    records: Mapping[str, Record],
    settings: Settings,
) -> tuple[dict[str, Fit], Reduction | None]:
    """Fit the model to the response of each estimator, or to the records.

    Where the study asks for it, the structure is reduced by the data that count; all other
    estimates are then fitted with that structure.
    """
    options: dict[str, Any] = {"starts": settings.starts, "seed": settings.seed}
    sources: dict[str, Any] = dict(responses)
    if settings.on_records:
        options["method"] = settings.method
        sources = {settings.method: [records[name] for name in task.settings.identify]}
    else:
        options["minimum_coherence"] = settings.response.minimum_coherence
    (counts, data), *others = sources.items()
    found, reduction, model = identify(task.model, data, **options), None, task.model
    if settings.reduce is not None:
        reduction = reduce(
            found,
            data,
            keep=task.settings.keep,
            drop=task.settings.drop,
            after_rise=settings.reduce.after_rise,
            **vars(settings.reduce.limits),
        )
        found, model = reduction.fit, model.with_fixed(**reduction.dropped)
    rest = {name: identify(model, other, **options) for name, other in others}
    return {counts: found, **rest}, reduction


def check(
    task: Task, fitted: Fit, records: Mapping[str, Record], settings: Settings
) -> dict[str, Verification | Comparison]:
    """Predict each segment that the fit has not seen, beside the rivals where there are any."""
    outputs, initial_state = task.model.outputs, settings.initial_state
    checked: dict[str, Verification | Comparison] = {}
    for name in task.settings.verify:
        record = records[name]
        if task.rivals:
            models = {task.settings.name: fitted, **task.rivals}
            checked[name] = verify(
                [*models.values()],
                record,
                names=[*models],
                initial_state=initial_state,
                outputs=outputs,
            )
        else:
            checked[name] = verify(fitted, record, initial_state=initial_state, outputs=outputs)
    return checked
