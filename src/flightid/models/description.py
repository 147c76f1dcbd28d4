"""Models from plain dictionaries: what a TOML file holds, checked key by key."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from flightid.errors import ModelError
from flightid.models.innovations.model import InnovationsModel
from flightid.models.language.reading import (
    read_parameter,
    read_table,
    read_text,
    read_texts,
    require_keys,
)
from flightid.models.linear.description import (
    innovations_from_table,
    innovations_to_table,
    system_from_table,
    system_to_table,
)
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.narx.description import narx_from_table, narx_to_table
from flightid.models.narx.model import NarxEquation
from flightid.models.parameters import Parameters
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.state_space.model import StateSpaceModel
from flightid.models.transfer.model import TransferFunction, TransferFunctionModel

Model = TransferFunctionModel | StateSpaceModel
"""Models with named parameters."""
SavedModel = Model | PolynomialModel | InnovationsModel | NarxEquation | LinearSystem
"""Whatever a file can hold."""

_TOP = {"kind", "name", "source", "note", "inputs", "outputs", "responses", "parameters"}
_TOP |= {"constraints", "schema"}
_RESPONSE = {"gain", "numerator", "denominator", "delay"}


def model_from_description(content: Mapping[str, object]) -> SavedModel:
    """Build a model from a dictionary such as a TOML file gives.

    Parameters
    ----------
    content : mapping
        Keys ``kind``, ``name``, ``inputs``, ``outputs``, ``parameters``, ``responses`` and, as
        needed, ``constraints``, ``source``, ``note``; with kind ``"state-space"`` those of
        `StateSpaceModel.from_dict`; with ``"polynomial"``, ``"innovations"``, ``"narx"`` or
        ``"linear"`` those that `model_to_description` writes.

    Returns
    -------
    TransferFunctionModel, StateSpaceModel, PolynomialModel, InnovationsModel, NarxEquation or
    LinearSystem

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type, or the model contradicts itself.

    Example
    -------
    >>> model_from_description({
    ...     "kind": "transfer", "inputs": {"u": "1"}, "outputs": {"y": "1"},
    ...     "parameters": {"K": {"value": 2.0}}, "responses": {"y/u": {"gain": "K"}}})
    TransferFunctionModel('transfer functions', 1 response [y/u], 1 parameters, 1 free)
    """
    kind = content.get("kind", "transfer")
    read = _READERS.get(kind) if isinstance(kind, str) else None
    if read is None:
        known = ", ".join(map(repr, _READERS))
        raise ModelError("kind of model is not known", found=repr(kind), needed=f"one of {known}")
    return read(content)


def model_to_description(model: SavedModel) -> dict[str, object]:
    """Plain values of a model with its kind, which `model_from_description` reads.

    Parameters
    ----------
    model : TransferFunctionModel, StateSpaceModel, PolynomialModel, InnovationsModel, NarxEquation
        or LinearSystem

    Returns
    -------
    dict

    Raises
    ------
    ModelError
        Another type.
    """
    if isinstance(model, InnovationsModel):
        return innovations_to_table(model)
    if isinstance(model, NarxEquation):
        return narx_to_table(model)
    if isinstance(model, LinearSystem):
        return system_to_table(model)
    if isinstance(model, TransferFunctionModel | StateSpaceModel | PolynomialModel):
        return model.to_dict()
    raise ModelError(
        "this cannot be written as a model",
        found=type(model).__name__,
        needed="a model; of a fit its `model`, of a NARX fit its `equation`",
    )


def _transfer(content: Mapping[str, object]) -> TransferFunctionModel:
    require_keys(content, _TOP, "the model")
    inputs = read_texts(read_table(content, "inputs"), "inputs")
    outputs = read_texts(read_table(content, "outputs"), "outputs")
    ties = read_texts(read_table(content, "constraints", required=False), "constraints")
    described = read_table(content, "parameters")
    parameters = [read_parameter(name, item, ties) for name, item in described.items()]
    stray = set(ties) - set(described)
    if stray:
        raise ModelError("a constraint names no parameter", found=", ".join(sorted(stray)))
    responses = tuple(
        _response(name, item, inputs, outputs)
        for name, item in read_table(content, "responses").items()
    )
    return TransferFunctionModel(
        responses,
        Parameters(parameters),
        units={**inputs, **outputs},
        name=read_text(content.get("name", "transfer functions"), "name"),
        source=read_text(content.get("source", ""), "source"),
        note=read_text(content.get("note", ""), "note"),
    )


def _response(
    name: str, item: object, inputs: Mapping[str, str], outputs: Mapping[str, str]
) -> TransferFunction:
    if not isinstance(item, dict):
        raise ModelError(f"response {name} must be a table", found=repr(item)[:80])
    require_keys(item, _RESPONSE, f"response {name}")
    output, _, source = name.partition("/")
    if output not in outputs or source not in inputs:
        raise ModelError(
            "name of a response is not 'output/input'",
            found=repr(name),
            needed=f"an output of {', '.join(outputs)} over an input of {', '.join(inputs)}",
        )

    def factors(key: str) -> tuple[str, ...]:
        listed = item.get(key, [])
        if not isinstance(listed, list):
            raise ModelError(f"{key} of response {name} must be a list of factors")
        return tuple(read_text(factor, f"{key} of response {name}") for factor in listed)

    return TransferFunction(
        output,
        source,
        read_text(item.get("gain", "1"), f"gain of response {name}"),
        factors("numerator"),
        factors("denominator"),
        read_text(item.get("delay", "0"), f"delay of response {name}"),
    )


_READERS: Mapping[str, Callable[[Mapping[str, object]], SavedModel]] = {
    "transfer": _transfer,
    "state-space": StateSpaceModel.from_dict,
    "polynomial": PolynomialModel.from_dict,
    "innovations": innovations_from_table,
    "narx": narx_from_table,
    "linear": system_from_table,
}
