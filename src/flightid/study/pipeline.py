"""All models of a study through the same stages: responses, fit, tests, verification."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from flightid.conventions import Light
from flightid.errors import DataError, FitError, FlightidError, StudyError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.frequency_domain.longer_windows import LongerWindows, second_pass
from flightid.inspection import Inspection
from flightid.models import GreyBoxModel
from flightid.record import Record
from flightid.responses import CoherentPairs, FrequencyResponse
from flightid.responses.coherent_pairs import DRIVING_DECADES, MINIMUM_DECADES
from flightid.responses.options import AUTOMATIC
from flightid.study.evidence import examined
from flightid.study.identified import ModelFits, ModelResults
from flightid.study.model_settings import UNBROKEN
from flightid.study.reducing import ReduceSettings
from flightid.study.stage_runner import StageResult, StageRunner, digest
from flightid.study.stages import (
    check,
    chosen_by,
    compare_free_run,
    estimate,
    examine_residuals,
    fit_equations,
    fit_without_equations,
    judge_reduction,
    scan_records,
    select_coherent,
)
from flightid.study.task import Task, narrowed
from flightid.validation import Comparison, Verification

Records = Mapping[str, StageResult[list[Record]]]


@dataclass(frozen=True, eq=False)
class Part:
    """One model up to its fit.

    Attributes
    ----------
    task : Task
        With the responses or inputs that coherence has chosen.
    responses : mapping of str to StageResult FrequencyResponse
        By estimator, the one that counts first.
    coherent : StageResult CoherentPairs or None
    fitted : StageResult ModelFits
    """

    task: Task
    responses: Mapping[str, StageResult[FrequencyResponse]]
    coherent: StageResult[CoherentPairs] | None
    fitted: StageResult[ModelFits]


def identify_models(
    tasks: Sequence[Task],
    records: Records,
    inspection: StageResult[Inspection] | None,
    reducing: ReduceSettings | None,
    runner: StageRunner,
    advance: Callable[..., None],
) -> tuple[StageResult[ModelResults], ...]:
    """Carry every model through its stages.

    All fits come first: models may be rivals of each other in the verification. A model whose data
    allow no fit is named, and the others stand; where none is left the study's error names each.

    Parameters
    ----------
    tasks : sequence of Task
    records : mapping of str to StageResult list of Record
        By name, which may stand for all manoeuvres of a file.
    inspection : StageResult Inspection or None
        Of the log that they come from.
    reducing : ReduceSettings or None
    runner : StageRunner
    advance : callable
        Is called three times for each model.

    Returns
    -------
    tuple of StageResult ModelResults
        What was found, with the hash of the fit and of all that was examined of it.
    """
    parts: list[Part] = []
    errors: dict[str, FlightidError] = {}
    for asked in tasks:
        task = start_from(asked, parts)
        try:
            parts.append(_identified(task, records, reducing, runner))
        except (DataError, FitError) as error:
            errors[task.settings.name] = error
            parts.append(_refused(task, error))
        advance(2)
    if errors and len(errors) == len(parts):
        raise _of_all(errors)
    fitted = {part.task.settings.name: part.fitted for part in parts}
    found = []
    for part in parts:
        before = len(runner.keys)
        item = _examine(part, records, fitted, runner)
        key = digest((part.fitted.key, runner.keys[before:], inspection))
        seen = None if inspection is None else inspection.value
        found.append(StageResult(_examined(item, seen), key))
        advance()
    return tuple(found)


def _of_all(errors: Mapping[str, FlightidError]) -> FlightidError:
    """The only error, or one of that kind that says why each model of the study has no fit."""
    first, *others = errors.values()
    if not others:
        return first
    steps = dict.fromkeys(f"{name}: {each.action}" for name, each in errors.items() if each.action)
    return type(first)(
        "no model of the study could be identified",
        found="; ".join(f"{name}: {each.reason}" for name, each in errors.items()),
        action="; ".join(steps) or None,
    )


def _refused(task: Task, error: FlightidError) -> Part:
    """A model that its data do not allow: it is named, and the others stand."""
    said = f"not identified: {error.reason}"
    finding = Finding("model-refused", Light.RED, said, str(error.action or ""))
    key = digest((task.settings.name, said))
    return Part(task, {}, None, StageResult(ModelFits(refused=finding), key))


def start_from(task: Task, earlier: Sequence[Part]) -> Task:
    """The model with start values that earlier models of the study gave.

    Raises
    ------
    StudyError
        No model of that name comes before this one.
    UnknownNameError
        A model has no such parameter.
    """
    model = task.model
    if model is None:
        return task
    for name, wanted in task.settings.values_from.items():
        fits = [part.fitted.value.fit for part in earlier if part.task.settings.name == name]
        if not fits or fits[0] is None:
            known = [part.task.settings.name for part in earlier]
            raise StudyError(
                f"study file, model {task.settings.name!r}: values_from names no earlier model",
                found=name,
                needed=", ".join(known) or "an earlier [[model]]",
            )
        given = fits[0].model.parameters
        model = model.with_values({each: given[each].value or 0.0 for each in wanted})
    return replace(task, model=model)


def _examined(item: ModelResults, inspection: Inspection | None) -> ModelResults:
    """The fit that counts with all that the study knows of it, so that one light shows."""
    fit = item.fit
    if fit is None:
        return item
    first, *others = item.fits.items()
    fits = dict([(first[0], examined(fit, item, inspection)), *others])
    return replace(item, fitted=replace(item.fitted, fits=fits))


def _identified(
    task: Task, records: Records, reducing: ReduceSettings | None, runner: StageRunner
) -> Part:
    """Responses and fits; once more where a light mode asks for windows that nobody chose."""

    def made(longer: LongerWindows | None = None) -> Part:
        responses = responses_of(task, records, runner, longer)
        return _fit(task, responses, records, reducing, runner)

    first = made()
    fit = first.fitted.value.fit
    if fit is None or not first.responses or task.settings.response.window_s != AUTOMATIC:
        return first
    counts = next(iter(first.responses.values())).value
    models = [fit.model] if isinstance(fit.model, GreyBoxModel) else []
    return second_pass(first, models, counts, made, banded=True)


def responses_of(
    task: Task, records: Records, runner: StageRunner, longer: LongerWindows | None = None
) -> dict[str, StageResult[FrequencyResponse]]:
    """By what made them, what counts first."""
    settings = task.settings
    if settings.band_rad_s is None or (task.model is not None and not settings.fit.on_responses):
        return {}
    asked = settings.response
    flown = [records[name] for name in settings.flown]
    found: dict[str, StageResult[FrequencyResponse]] = {}
    for estimator in asked.estimators:
        made = runner.stage(
            f"response: {settings.name}, {estimator}",
            estimate,
            flown,
            asked.moved(task.inputs),
            # Outputs beside those that are fitted help to tell initial states: bias is taken out.
            settings.outputs or task.outputs,
            settings.band_rad_s,
            estimator,
            asked.of_estimates,
            *(() if longer is None else (longer,)),
        )
        found.setdefault(made.value.estimator, made)
    return found


def _fit(
    task: Task,
    responses: Mapping[str, StageResult[FrequencyResponse]],
    records: Records,
    reducing: ReduceSettings | None,
    runner: StageRunner,
) -> Part:
    settings, coherent = task.settings, None
    first = next(iter(responses.values()), None)
    if first is not None and (settings.by_coherence or task.model is None):
        decades = settings.response.minimum_decades
        usual = DRIVING_DECADES if task.model is None else MINIMUM_DECADES
        coherent = runner.stage(
            f"coherence: {settings.name}",
            select_coherent,
            first,
            settings.response.minimum_coherence,
            usual if decades is None else decades,
            settings.responses == (UNBROKEN,),
            task.model is None and decades is None,
        )
        task = chosen_by(task, coherent.value)
    flown = [records[name] for name in settings.identify]
    if task.model is None:
        structure = settings.structure
        assert structure is not None
        told = replace(structure, coherence=(), select=())
        unseen = [records[name] for name in structure.select]
        scan = None
        if told.scans_orders and task.inputs:
            tried = {**told.orders, **told.options}
            asked = (told.structure, tried, task.inputs, told.outputs, flown, unseen)
            scan = runner.stage(f"orders: {settings.name}", scan_records, *asked)
        fitted = runner.stage(
            f"fit: {settings.name}", fit_without_equations, told, task.inputs, flown, unseen, scan
        )
        return Part(task, responses, coherent, fitted)
    if reducing is not None and not settings.reduce:
        reducing = None
    if reducing is not None:
        reducing = replace(reducing, keep=settings.keep, drop=settings.drop)
    sources: dict[str, Any] = {settings.fit.method: flown}
    if settings.fit.on_responses:
        beside = [records[name] for name in settings.joint]
        sources = {
            name: (response, beside) if beside else response for name, response in responses.items()
        }
    fitted = runner.stage(
        f"fit: {settings.name}",
        fit_equations,
        task.model,
        sources,
        settings.fit,
        settings.response.minimum_coherence,
        coherent,
        reducing,
    )
    return Part(task, responses, coherent, fitted)


def _examine(
    part: Part, records: Records, fitted: Mapping[str, StageResult[ModelFits]], runner: StageRunner
) -> ModelResults:
    """Residual tests, spectra and verification of the fit that counts."""
    settings = part.task.settings
    responses = {name: each.value for name, each in part.responses.items()}
    coherent = None if part.coherent is None else part.coherent.value
    beside = part.task.reference
    found = ModelResults(settings, responses, coherent, part.fitted.value, reference=beside)
    fit = part.fitted.value.fit
    if fit is None:
        return found
    if part.task.model is None:
        seen = [record for name in settings.identify for record in records[name].value]
        channels = (part.task.inputs, part.task.outputs)
        found = replace(found, training=tuple(narrowed(each, *channels) for each in seen))
    elif fit.responses:
        flown = tuple(each for name in settings.flown for each in records[name].value)
        found = replace(found, training=flown)
    counts = StageResult(fit, part.fitted.key)
    tests = spectra = None
    if settings.check.tests_residuals:
        tests = runner.stage(f"residual tests: {settings.name}", examine_residuals, counts).value
    if settings.check.compares_spectra:
        first = records[settings.flown[0]]
        spectra = runner.stage(
            f"spectra: {settings.name}", compare_free_run, counts, first, settings.check.options
        ).value
    verified = _verifications(part, counts, records, fitted, runner)
    found = replace(
        found,
        tests=None if isinstance(tests, Finding) else tests,
        untested=tuple(each for each in (tests, spectra) if isinstance(each, Finding)),
        spectra=None if isinstance(spectra, Finding) else spectra,
        verifications=verified,
        unfitted=tuple(each for name in settings.unfitted for each in records[name].value),
    )
    if found.reduction is None or not found.reduction.dropped:
        return found
    start = StageResult(found.reduction.start, f"start of {part.fitted.key}")
    outputs = settings.outputs or fit.model.outputs
    judged = tuple(
        runner.stage(
            f"reduction: {settings.name}, {name}",
            judge_reduction,
            counts,
            start,
            records[name],
            outputs,
            settings.check.options,
        ).value
        for name in settings.verify
    )
    return replace(found, reduction_judged=judged)


def _verifications(
    part: Part,
    counts: StageResult[Any],
    records: Records,
    fitted: Mapping[str, StageResult[ModelFits]],
    runner: StageRunner,
) -> dict[str, Verification | Comparison]:
    settings = part.task.settings
    rivals: dict[str, Any] = dict(part.task.rivals)
    for name in settings.rivals:
        rival = fitted[name].value.fit if name in fitted else None
        if rival is not None:
            rivals[name] = StageResult(rival, fitted[name].key)
    options: dict[str, Any] = settings.check.options
    if settings.check.against_responses and part.responses:
        options["responses"] = next(iter(part.responses.values()))
    outputs = settings.outputs or counts.value.model.outputs
    checked = {}
    for horizon in settings.check.ahead:
        ahead = "" if horizon == "free_run" else f", {horizon} ahead"
        for name in settings.verify:
            checked[name + ahead] = runner.stage(
                f"verification: {settings.name}, {name}{ahead}",
                check,
                settings.name,
                counts,
                rivals,
                records[name],
                outputs,
                options,
                horizon,
            ).value
    return checked
