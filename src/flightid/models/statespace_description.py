"""State-space models from plain dictionaries, and back."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, TypedDict

from flightid.errors import ModelError
from flightid.models.parameters import Parameter, Parameters
from flightid.models.reading import (
    read_number,
    read_parameter,
    read_table,
    read_text,
    read_texts,
    require_keys,
)
from flightid.models.statespace_parts import Output

if TYPE_CHECKING:
    from flightid.models.statespace import StateSpaceModel

_KEYS = {"schema", "kind", "name", "source", "note", "states", "inputs", "outputs", "parameters"}
_KEYS |= {"constants", "constraints", "equations", "delays", "trim", "responses"}
_OUTPUT = {"expression", "unit"}
_CONSTANT = {"value", "unit", "note"}
_SYMPY_FUNCTION = re.compile(r"\b(Abs|Min|Max)\(")


class Description(TypedDict):
    """Arguments of a state-space model."""

    states: dict[str, str]
    input_units: dict[str, str]
    measurements: dict[str, Output]
    equations: dict[str, str]
    parameters: Parameters
    delays: dict[str, str]
    trim: dict[str, float]
    pairs: tuple[str, ...]
    name: str
    source: str
    note: str


def from_plain(content: Mapping[str, object]) -> Description:
    """Read the tables of a state-space model.

    Parameters
    ----------
    content : mapping
        As a TOML file gives it; formulas may be SymPy objects.

    Returns
    -------
    Description

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type.
    """
    require_keys(content, _KEYS, "the model")
    states = read_texts(read_table(content, "states"), "states")
    trim = read_table(content, "trim", required=False)
    return Description(
        states=states,
        input_units=read_texts(read_table(content, "inputs"), "inputs"),
        measurements={
            name: _output(name, item, states)
            for name, item in read_table(content, "outputs").items()
        },
        equations=_formulas(content, "equations"),
        parameters=_parameters(content),
        delays=_formulas(content, "delays", required=False),
        trim={name: read_number(value, f"trim.{name}") for name, value in trim.items()},
        pairs=_pairs(content.get("responses", [])),
        name=read_text(content.get("name", "state space"), "name"),
        source=read_text(content.get("source", ""), "source"),
        note=read_text(content.get("note", ""), "note"),
    )


def _formula(item: object, subject: str) -> str:
    """A formula as text; a SymPy object by its own spelling."""
    if type(item).__module__.partition(".")[0] == "sympy":
        return _SYMPY_FUNCTION.sub(lambda match: match.group().lower(), str(item))
    return read_text(item, subject)


def _formulas(content: Mapping[str, object], key: str, *, required: bool = True) -> dict[str, str]:
    items = read_table(content, key, required=required)
    return {_formula(left, key): _formula(right, f"{key}.{left}") for left, right in items.items()}


def _output(name: str, item: object, states: Mapping[str, str]) -> Output:
    if isinstance(item, dict):
        require_keys(item, _OUTPUT, f"output {name}")
        expression = _formula(item.get("expression", name), f"outputs.{name}.expression")
        unit = item.get("unit", states.get(expression))
    else:
        expression = _formula(item, f"outputs.{name}")
        unit = states.get(expression)
    if unit is None:
        raise ModelError(
            f"output {name} has no unit",
            found=repr(expression),
            needed='a state, or { expression = "...", unit = "..." }',
        )
    return Output(expression, read_text(unit, f"outputs.{name}.unit"))


def _parameters(content: Mapping[str, object]) -> Parameters:
    """Parameters, and constants as fixed parameters behind them."""
    ties = _formulas(content, "constraints", required=False)
    described = read_table(content, "parameters", required=False)
    found = [read_parameter(name, item, ties) for name, item in described.items()]
    stray = set(ties) - set(described)
    if stray:
        raise ModelError("a constraint names no parameter", found=", ".join(sorted(stray)))
    for name, item in read_table(content, "constants", required=False).items():
        plain = item if isinstance(item, dict) else {"value": item}
        require_keys(plain, _CONSTANT, f"constant {name}")
        found.append(read_parameter(name, {**plain, "fixed": True}, {}))
    return Parameters(found)


def _pairs(item: object) -> tuple[str, ...]:
    if not isinstance(item, list | tuple):
        raise ModelError("responses must be a list of 'output/input'", found=repr(item)[:80])
    return tuple(read_text(each, "responses") for each in item)


def to_plain(model: StateSpaceModel) -> dict[str, object]:
    """Plain values that `from_plain` reads.

    Parameters
    ----------
    model : StateSpaceModel

    Returns
    -------
    dict
    """
    return {
        "kind": "state-space",
        "name": model.name,
        "states": dict(model.states),
        "inputs": dict(model.input_units),
        "outputs": {
            name: {"expression": output.expression, "unit": output.unit}
            for name, output in model.measurements.items()
        },
        "parameters": {name: _plain(item) for name, item in model.parameters.items()},
        "equations": dict(model.equations),
        "delays": {name: delay for name, delay in model.delays.items() if delay != "0"},
        "trim": dict(model.trim),
        "responses": list(model.pairs),
        "source": model.source,
        "note": model.note,
    }


def _plain(parameter: Parameter) -> dict[str, object]:
    return {key: value for key, value in parameter.to_dict().items() if value is not None}


def lines(model: StateSpaceModel) -> list[str]:
    """Equations, outputs and delays as text, one a line.

    Parameters
    ----------
    model : StateSpaceModel

    Returns
    -------
    list of str
    """
    equations = [f"{left} = {right}" for left, right in model.equations.items()]
    outputs = [
        f"output {name} = {output.expression} [{output.unit}]"
        for name, output in model.measurements.items()
    ]
    delays = [
        f"{name} acts after {delay} s" for name, delay in model.delays.items() if delay != "0"
    ]
    return [*equations, *outputs, *delays]


def one_line(model: StateSpaceModel) -> str:
    """Name and size of a model.

    Parameters
    ----------
    model : StateSpaceModel

    Returns
    -------
    str
    """
    counts = {"state": model.states, "input": model.inputs, "output": model.outputs}
    sizes = [f"{len(x)} {word}{'' if len(x) == 1 else 's'}" for word, x in counts.items()]
    parameters = f"{len(model.parameters)} parameters, {len(model.parameters.free)} free"
    return f"StateSpaceModel({model.name!r}, {', '.join(sizes)}, {parameters})"
