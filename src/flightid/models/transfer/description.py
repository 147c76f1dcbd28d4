"""Transfer functions from plain values, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.errors import ModelError
from flightid.models.language.reading import (
    read_table,
    read_text,
    read_texts,
    require_keys,
)
from flightid.models.parameter_table import read_parameter
from flightid.models.parameters import Parameters
from flightid.models.transfer.model import TransferFunction, TransferFunctionModel

_TOP = {"kind", "name", "source", "note", "inputs", "outputs", "responses", "parameters"}
_TOP |= {"constraints", "schema"}
_RESPONSE = {"gain", "numerator", "denominator", "delay"}


def transfer_from_table(content: Mapping[str, object]) -> TransferFunctionModel:
    """Transfer functions from plain values.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type, or the model contradicts itself.
    """
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
