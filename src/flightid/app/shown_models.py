"""Models with equations as the page is told them."""

from __future__ import annotations

import math
from dataclasses import replace

from flightid.app.model_schemas import ShownEquation, ShownModel, ShownParameter
from flightid.errors import OptionError
from flightid.models import GreyBoxModel, StateSpaceModel, load_structure
from flightid.models.parameters import Parameter

AXES = ("roll", "pitch", "yaw")


def axes_of(name: str) -> list[str]:
    """Axes that a library model is written for; none where it is of one vehicle."""
    try:
        for axis in AXES:
            load_structure(name, axis=axis)
    except OptionError:
        return []
    return list(AXES)


def shown_model(key: str, model: GreyBoxModel, axes: list[str] | None = None) -> ShownModel:
    """What the page is told of a model; `key` is what a study names it by."""
    is_state_space = isinstance(model, StateSpaceModel)
    units = model.units
    return ShownModel(
        key=key,
        title=model.name,
        kind="state-space" if is_state_space else "transfer",
        axes=axes or [],
        inputs={name: units[name] for name in model.inputs},
        outputs={name: units[name] for name in model.outputs},
        equations=_equations(model),
        definitions=_definitions(model),
        measured=_measured(model),
        notes=_notes(model),
        parameters=[shown_parameter(each) for each in model.parameters.values()],
        source=model.source,
        note=model.note,
    )


def _equations(model: GreyBoxModel) -> list[ShownEquation]:
    if isinstance(model, StateSpaceModel):
        return [ShownEquation(left=a, right=b) for a, b in model.equations.items()]
    return [
        ShownEquation(
            left=f"{each.output}/{each.input}",
            right=each.formula,
            delay="" if each.delay == "0" else each.delay,
        )
        for each in model.responses
    ]


def _definitions(model: GreyBoxModel) -> list[ShownEquation]:
    if not isinstance(model, StateSpaceModel):
        return []
    return [ShownEquation(left=n, right=d.expression) for n, d in model.definitions.items()]


def _measured(model: GreyBoxModel) -> list[ShownEquation]:
    """Outputs that are no states."""
    if not isinstance(model, StateSpaceModel):
        return []
    return [
        ShownEquation(left=name, right=output.expression)
        for name, output in model.measurements.items()
        if output.expression != name
    ]


def _notes(model: GreyBoxModel) -> list[str]:
    if not isinstance(model, StateSpaceModel):
        return []
    late = [f"{name} acts after {delay} s" for name, delay in model.delays.items() if delay != "0"]
    return [*late, *(f"block {block.shown()}" for block in model.blocks)]


def shown_parameter(each: Parameter, own: Parameter | None = None) -> ShownParameter:
    """A parameter; `own` is what the model's file says of it, where a study goes over that."""
    start = own or each
    return ShownParameter(
        name=each.name,
        value=each.value,
        start=start.value,
        unit=each.unit,
        low=each.minimum if math.isfinite(each.minimum) else None,
        high=each.maximum if math.isfinite(each.maximum) else None,
        free=each.free,
        tie=each.tie,
        note=each.note,
        changed=replace(start, note="") != replace(each, note=""),
    )
