"""The stages of a study, one function each, from the records to the verified models."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from flightid.errors import DataError, StudyError, UnknownNameError
from flightid.findings import Finding
from flightid.identification import Fit, Reduction, identify, reduce
from flightid.models import GreyBoxModel, StateSpaceModel, load_structure
from flightid.responses import (
    CoherentPairs,
    FrequencyResponse,
    coherent_pairs,
    estimate_response,
)
from flightid.study.flown import Flown
from flightid.study.model_settings import UNBROKEN, ModelSettings
from flightid.study.reducing import ReduceSettings
from flightid.validation import Comparison, ResidualTests, Verification, residual_tests, verify


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
    reference : TransferFunctionModel or StateSpaceModel, optional
        Model that stands beside the estimates.
    """

    settings: ModelSettings
    model: GreyBoxModel
    rivals: Mapping[str, GreyBoxModel] = field(default_factory=dict)
    reference: GreyBoxModel | None = None

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
    coherent : CoherentPairs or None
        Which responses were fitted, where coherence chose them.
    tests : ResidualTests or None
        Of the residuals of a fit to records, where the study asks for them.
    reference : TransferFunctionModel or StateSpaceModel, optional
        Model that stands beside the estimates.
    """

    settings: ModelSettings
    responses: Mapping[str, FrequencyResponse]
    fits: Mapping[str, Fit]
    verifications: Mapping[str, Verification | Comparison]
    reduction: Reduction | None = None
    coherent: CoherentPairs | None = None
    tests: ResidualTests | None = None
    reference: GreyBoxModel | None = None

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
        tests = () if self.tests is None else self.tests.findings
        return (*first, *self.fit.findings, *path, *tests, *checks)

    def to_dict(self) -> dict[str, object]:
        """Plain values of every result."""
        return {
            "name": self.settings.name,
            "responses": {key: value.to_dict() for key, value in self.responses.items()},
            "fits": {key: value.to_dict() for key, value in self.fits.items()},
            "reduction": None if self.reduction is None else self.reduction.to_dict(),
            "coherent": None if self.coherent is None else self.coherent.to_dict(),
            "residual_tests": None if self.tests is None else self.tests.to_dict(),
            "verifications": {key: value.to_dict() for key, value in self.verifications.items()},
        }


def load_task(settings: ModelSettings) -> Task:
    """Load a model and apply the overrides of the study.

    Raises
    ------
    UnknownNameError
        There is no such library model, or no such parameter in it.
    ModelError
        A response that the model does not have.
    """
    path = settings.template_path
    model = load_structure(settings.template if path is None else path, axis=settings.axis)
    parameters = model.parameters
    for name, given in settings.parameters.items():
        parameters = parameters.with_parameter(replace(parameters[name], **given))
    model = replace(model, parameters=parameters)
    if settings.outputs:
        model = _with_responses(model, _of_outputs(model, settings.outputs))
    if settings.responses and not settings.by_coherence:
        model = _with_responses(model, settings.responses)
    rivals = {
        name: load_structure(path if path.endswith(".toml") else name, axis=settings.axis)
        for name, path in settings.rivals.items()
    }
    reference = settings.reference
    beside = None if reference is None else load_structure(reference, axis=settings.axis)
    return Task(settings, model, rivals, beside)


def _of_outputs(model: GreyBoxModel, outputs: tuple[str, ...]) -> tuple[str, ...]:
    """Responses of some outputs."""
    for name in outputs:
        if name not in model.outputs:
            raise UnknownNameError(
                "the model has no such output", found=name, needed=", ".join(model.outputs)
            )
    return tuple(name for name in model.response_names if name.split("/")[0] in outputs)


def _with_responses(model: GreyBoxModel, names: tuple[str, ...]) -> GreyBoxModel:
    """The model of which a fit takes these responses alone."""
    if isinstance(model, StateSpaceModel):
        return model.with_responses(*names)
    kept = tuple(each for each in model.responses if each.name in names)
    missing = [name for name in names if name not in model.response_names]
    if missing:
        raise DataError(
            "the model has no such response",
            found=", ".join(missing),
            needed=", ".join(model.response_names),
        )
    return replace(model, responses=kept)


def estimate(task: Task, records: Flown) -> dict[str, FrequencyResponse]:
    """Frequency responses of one model's records by each estimator, the one that counts first."""
    settings = task.settings
    chosen, band = settings.response, settings.band_rad_s
    if not settings.fit.on_responses or band is None:
        return {}
    flown = records.of(settings.identify)
    # Outputs beside those that are fitted help to tell initial states when bias is taken out.
    wanted = settings.outputs or task.model.outputs
    held = [name for name in wanted if all(name in record for record in flown)]
    return {
        estimator: estimate_response(
            flown,
            inputs=chosen.moved(task.model.inputs),
            outputs=held,
            excitations=chosen.instruments if estimator == "instrument" else None,
            band_rad_s=band,
            n_omega=chosen.n_omega,
            window_s=list(chosen.window_s) or "auto",
            estimator=estimator,
            loop=chosen.declared_loop,
        )
        for estimator in chosen.estimators
    }


def choose_responses(
    task: Task, responses: Mapping[str, FrequencyResponse]
) -> tuple[Task, CoherentPairs | None]:
    """Where coherence says which responses are fitted: the model with those alone.

    Raises
    ------
    DataError
        No response is coherent.
    """
    settings = task.settings
    if not settings.by_coherence or not responses:
        return task, None
    response = next(iter(responses.values()))
    coherent = coherent_pairs(
        response,
        minimum_coherence=settings.response.minimum_coherence,
        minimum_decades=settings.response.minimum_decades,
    )
    if settings.responses == (UNBROKEN,):
        coherent = unbroken(response, coherent)
    names = tuple(name for name in coherent.names if name in task.model.response_names)
    if not names:
        raise DataError(
            f"no response of model {settings.name!r} is coherent",
            found="; ".join(f"{pair.name}: {pair.reason}" for pair in coherent.pairs),
            needed=f"coherence {settings.response.minimum_coherence:g} over "
            f"{settings.response.minimum_decades:g} decades",
            action="lower [response] minimum_coherence, or fly the inputs harder",
        )
    return replace(task, model=_with_responses(task.model, names)), coherent


def unbroken(response: FrequencyResponse, coherent: CoherentPairs) -> CoherentPairs:
    """The choice with each response's widest coherent band without a gap in place of all."""
    judged = []
    for pair in coherent.pairs:
        band = response.pair(*pair.name.split("/")).usable_band(coherent.minimum_coherence)
        decades = 0.0 if band is None else math.log10(band[1] / band[0])
        kept = pair.kept and decades >= coherent.minimum_decades
        reason = pair.reason if kept or not pair.kept else "no unbroken band is wide enough"
        judged.append(replace(pair, band_rad_s=band, decades=decades, kept=kept, reason=reason))
    return replace(coherent, pairs=tuple(judged))


def fit(
    task: Task,
    responses: Mapping[str, FrequencyResponse],
    records: Flown,
    reducing: ReduceSettings | None,
    coherent: CoherentPairs | None = None,
) -> tuple[dict[str, Fit], Reduction | None]:
    """Fit the model to the response of each estimator, or to the records.

    Where the study asks for it, the structure is reduced by the data that count; all other
    estimates are then fitted with that structure.
    """
    settings = task.settings
    options: dict[str, Any] = {"method": settings.fit.method, **settings.fit.options}
    if settings.fit.on_responses:
        options.setdefault("minimum_coherence", settings.response.minimum_coherence)
        if coherent is not None:
            fitted = set(task.model.response_names)
            bands = {name: band for name, band in coherent.bands.items() if name in fitted}
            options.setdefault("band_rad_s", bands)
    (counts, data), *others = _sources(task, responses, records).items()
    model, reduction = task.model, None
    if reducing is None or not settings.reduce:
        counted = identify(model, data, **options)
    else:
        reduction = _reduced(task, data, options, reducing)
        counted, model = reduction.fit, model.with_fixed(**reduction.dropped)
        if reducing.rough:
            counted = identify(reduction.fit.model, data, **options)
    rest = {name: identify(model, other, **options) for name, other in others}
    return {counts: counted, **rest}, reduction


def _reduced(
    task: Task,
    data: Any,  # noqa: ANN401  # whatever identify takes
    options: Mapping[str, Any],
    reducing: ReduceSettings,
) -> Reduction:
    """The path of the structure, on the data as they are or without what only intervals need."""
    given = dict(options)
    if reducing.rough and isinstance(data, FrequencyResponse):
        data = replace(data, errors=None, linear=None)
        given["correct_bias"] = False
    return reduce(
        identify(task.model, data, **given),
        data,
        keep=task.settings.keep,
        drop=task.settings.drop,
        after_rise=reducing.after_rise,
        **vars(reducing.limits),
    )


def _sources(
    task: Task, responses: Mapping[str, FrequencyResponse], records: Flown
) -> dict[str, Any]:
    """What the model is fitted to, by estimator or method, what counts first."""
    settings = task.settings
    if not settings.fit.on_responses:
        return {settings.fit.method: records.of(settings.identify)}
    if settings.joint:
        beside = records.of(settings.joint)
        return {name: (response, beside) for name, response in responses.items()}
    return dict(responses)


def start_from(task: Task, earlier: Sequence[Identified]) -> Task:
    """The model with start values that earlier models of the study gave.

    Raises
    ------
    StudyError
        No model of that name comes before this one.
    UnknownNameError
        A model has no such parameter.
    """
    model = task.model
    for name, wanted in task.settings.values_from.items():
        given = [item for item in earlier if item.settings.name == name]
        if not given:
            raise StudyError(
                f"study file, model {task.settings.name!r}: values_from names no earlier model",
                found=name,
                needed=", ".join(item.settings.name for item in earlier) or "an earlier [[model]]",
            )
        model = model.with_values(
            {each: given[0].fit.model.parameters[each].value or 0.0 for each in wanted}
        )
    return replace(task, model=model)


def check(
    task: Task,
    fitted: Fit,
    records: Flown,
    response: FrequencyResponse | None = None,
) -> dict[str, Verification | Comparison]:
    """Predict each record that the fit has not seen, beside the rivals where there are any."""
    outputs, options = task.model.outputs, task.settings.check.options
    if task.settings.check.against_responses and response is not None:
        options["responses"] = response
    if task.settings.outputs:
        outputs = task.settings.outputs
    checked: dict[str, Verification | Comparison] = {}
    for name in task.settings.verify:
        flown = records.of([name])
        held = [output for output in outputs if all(output in record for record in flown)]
        if task.rivals:
            models = {task.settings.name: fitted, **task.rivals}
            checked[name] = verify(
                [*models.values()], flown, names=[*models], outputs=held, **options
            )
        else:
            checked[name] = verify(fitted, flown, outputs=held, **options)
    return checked


def examine_residuals(task: Task, fitted: Fit) -> ResidualTests | None:
    """Residual tests of a fit to records, where the study asks for them."""
    if not task.settings.check.residual_tests or not fitted.records:
        return None
    return residual_tests(fitted)
