"""Models from plain dictionaries: what a TOML file holds, checked key by key."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from flightid.errors import ModelError
from flightid.models.parameters import Parameter, Parameters
from flightid.models.transfer import TransferFunction, TransferFunctionModel

MAXIMUM_ENTRIES = 1_000
_TOP = {"kind", "name", "source", "note", "inputs", "outputs", "responses", "parameters"}
_TOP |= {"constraints", "schema"}
_PARAMETER = {"value", "unit", "min", "max", "fixed", "tie", "note", "status"}
_RESPONSE = {"gain", "numerator", "denominator", "delay"}


def model_from_description(content: Mapping[str, object]) -> TransferFunctionModel:
    """Build a model from a dictionary such as a TOML file gives.

    Parameters
    ----------
    content : mapping
        Keys ``kind``, ``name``, ``inputs``, ``outputs``, ``parameters``, ``responses`` and, as
        needed, ``constraints``, ``source``, ``note``.

    Returns
    -------
    TransferFunctionModel

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
    _only(content, _TOP, "the model")
    kind = content.get("kind", "transfer")
    if kind != "transfer":
        raise ModelError("kind of model is not known", found=repr(kind), needed="'transfer'")
    inputs = _texts(_table(content, "inputs"), "inputs")
    outputs = _texts(_table(content, "outputs"), "outputs")
    ties = _texts(_table(content, "constraints", required=False), "constraints")
    described = _table(content, "parameters")
    parameters = [_parameter(name, item, ties) for name, item in described.items()]
    stray = set(ties) - set(described)
    if stray:
        raise ModelError("a constraint names no parameter", found=", ".join(sorted(stray)))
    responses = tuple(
        _response(name, item, inputs, outputs)
        for name, item in _table(content, "responses").items()
    )
    return TransferFunctionModel(
        responses,
        Parameters(parameters),
        units={**inputs, **outputs},
        name=_text(content.get("name", "transfer functions"), "name"),
        source=_text(content.get("source", ""), "source"),
        note=_text(content.get("note", ""), "note"),
    )


def _only(item: Mapping[str, object], known: set[str], subject: str) -> None:
    unknown = set(item) - known
    if unknown:
        raise ModelError(
            f"{subject} has an unknown key",
            found=", ".join(sorted(map(str, unknown))),
            needed=f"one of {', '.join(sorted(known))}",
        )


def _table(content: Mapping[str, object], key: str, *, required: bool = True) -> dict[str, Any]:
    item = content.get(key, None if required else {})
    if not isinstance(item, dict) or (required and not item):
        raise ModelError(f"the model has no table [{key}]", needed="a table with entries")
    if len(item) > MAXIMUM_ENTRIES:
        raise ModelError(
            f"table [{key}] is too long", found=len(item), needed=f"at most {MAXIMUM_ENTRIES}"
        )
    return item


def _text(item: object, subject: str) -> str:
    if isinstance(item, bool) or not isinstance(item, str | int | float):
        raise ModelError(f"{subject} must be a text", found=repr(item)[:80])
    return str(item)


def _texts(item: Mapping[str, object], subject: str) -> dict[str, str]:
    return {name: _text(value, f"{subject}.{name}") for name, value in item.items()}


def _number(item: object, subject: str) -> float:
    if isinstance(item, bool) or not isinstance(item, int | float):
        raise ModelError(f"{subject} must be a number", found=repr(item)[:80])
    try:
        return float(item)
    except OverflowError as error:
        raise ModelError(f"{subject} is too large", found="an integer beyond 1e308") from error


def _parameter(name: str, item: object, ties: Mapping[str, str]) -> Parameter:
    if not isinstance(item, dict):
        item = {"value": item}
    _only(item, _PARAMETER, f"parameter {name}")
    fixed = item.get("fixed", item.get("status") == "fixed")
    if not isinstance(fixed, bool):
        raise ModelError(f"parameters.{name}.fixed must be true or false", found=repr(fixed)[:80])
    tie = ties.get(name, item.get("tie"))

    def bound(key: str, default: float) -> float:
        value = item.get(key)
        return default if value is None else _number(value, f"parameters.{name}.{key}")

    value = item.get("value")
    return Parameter(
        name,
        None if value is None else _number(value, f"parameters.{name}.value"),
        _text(item.get("unit", "1"), f"parameters.{name}.unit"),
        minimum=bound("min", -math.inf),
        maximum=bound("max", math.inf),
        free=not fixed,
        tie=None if tie is None else _text(tie, f"parameters.{name}.tie"),
        note=_text(item.get("note", ""), f"parameters.{name}.note"),
    )


def _response(
    name: str, item: object, inputs: Mapping[str, str], outputs: Mapping[str, str]
) -> TransferFunction:
    if not isinstance(item, dict):
        raise ModelError(f"response {name} must be a table", found=repr(item)[:80])
    _only(item, _RESPONSE, f"response {name}")
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
        return tuple(_text(factor, f"{key} of response {name}") for factor in listed)

    return TransferFunction(
        output,
        source,
        _text(item.get("gain", "1"), f"gain of response {name}"),
        factors("numerator"),
        factors("denominator"),
        _text(item.get("delay", "0"), f"delay of response {name}"),
    )
