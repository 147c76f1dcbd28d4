"""One model of a study before it is identified: loaded, with its channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path

from flightid.conventions import Role
from flightid.errors import DataError, UnknownNameError
from flightid.frozen import dataclass
from flightid.models import GreyBoxModel, Model, StateSpaceModel, load_model, load_structure
from flightid.record import Record
from flightid.study.model_settings import ModelSettings


@dataclass(frozen=True, eq=False)
class Task:
    """One model to identify.

    Attributes
    ----------
    settings : ModelSettings
        What was asked.
    inputs, outputs : tuple of str
        Channels that the model takes from its records: of the outputs those that are asked for.
    model : TransferFunctionModel, StateSpaceModel or None
        Equations and start values, overrides applied; None for a structure without equations.
    reference : Model or None
        Model that stands beside the estimates.
    rivals : mapping of str to Model
        Models to verify side by side with the fit, by name; those of the study itself are not
        among them.
    """

    settings: ModelSettings
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    model: GreyBoxModel | None = None
    reference: Model | None = None
    rivals: Mapping[str, Model] = field(default_factory=dict)


def narrowed(record: Record, inputs: Sequence[str], outputs: Sequence[str]) -> Record:
    """The channels of a model, in its roles: another model may see them otherwise.

    Injected signals stay beside them: residuals of a closed loop are tested against those.
    """
    roles = {**dict.fromkeys(inputs, Role.INPUT), **dict.fromkeys(outputs, Role.OUTPUT)}
    beside = [name for name in record.excitations if name not in roles]
    return record.select([*roles, *beside]).with_roles(**roles)


def load_task(settings: ModelSettings, others: tuple[str, ...] = ()) -> Task:
    """Load a model and apply the overrides of the study.

    Parameters
    ----------
    settings : ModelSettings
    others : tuple of str
        Names of the study's models, which may be rivals of each other.

    Raises
    ------
    UnknownNameError
        There is no such library model, or no such parameter in it.
    ModelError
        A response that the model does not have.
    """
    rivals = {
        name: load_model(source_of(path), axis=settings.axis)
        for name, path in settings.rival_sources.items()
        if name not in others
    }
    structure = settings.structure
    if structure is not None or settings.template is None:
        inputs, outputs = (structure.inputs, structure.outputs) if structure else ((), ())
        theirs = None if settings.reference is None else load_model(source_of(settings.reference))
        return Task(settings, inputs, outputs, reference=theirs, rivals=rivals)
    model = load_structure(source_of(settings.template), axis=settings.axis)
    parameters = model.parameters
    for name, given in settings.parameters.items():
        told = {key: value for key, value in vars(given).items() if value is not None}
        parameters = parameters.with_parameter(replace(parameters[name], **told))
    model = replace(model, parameters=parameters)
    outputs = settings.outputs or model.outputs
    if settings.outputs:
        model = with_responses(model, _of_outputs(model, outputs))
        if isinstance(model, StateSpaceModel) and not settings.fit.on_responses:
            model = model.with_outputs(*outputs)
    if settings.responses and not settings.by_coherence:
        model = with_responses(model, settings.responses)
    reference = settings.reference
    beside = None if reference is None else load_structure(source_of(reference), axis=settings.axis)
    return Task(settings, model.inputs, outputs, model, beside, rivals)


def _of_outputs(model: GreyBoxModel, outputs: tuple[str, ...]) -> tuple[str, ...]:
    """Responses of some outputs."""
    for name in outputs:
        if name not in model.outputs:
            raise UnknownNameError(
                "the model has no such output", found=name, needed=", ".join(model.outputs)
            )
    return tuple(name for name in model.response_names if name.split("/")[0] in outputs)


def source_of(name: str) -> str | Path:
    """A library name, or the path of a model file."""
    return Path(name) if name.endswith(".toml") else name


def with_responses(model: GreyBoxModel, names: tuple[str, ...]) -> GreyBoxModel:
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
