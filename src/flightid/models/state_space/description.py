"""State-space models from plain dictionaries, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypedDict

from flightid.errors import ModelError
from flightid.models.language.blocks import ModelBlock, read_block
from flightid.models.language.reading import (
    read_number,
    read_table,
    read_text,
    read_texts,
    require_keys,
)
from flightid.models.language.record_values import RecordValue, read_record_value
from flightid.models.language.sympy_input import is_sympy, sympy_formula
from flightid.models.language.tables import TableFunction, read_table_function
from flightid.models.parameter_table import read_parameter
from flightid.models.parameters import Parameter, Parameters
from flightid.models.state_space.linear import Linearisation
from flightid.models.state_space.parts import Output

_KEYS = {"schema", "kind", "name", "source", "note", "states", "inputs", "outputs", "parameters"}
_KEYS |= {"constants", "constraints", "equations", "delays", "trim", "responses", "definitions"}
_KEYS |= {"tables", "blocks", "initial", "biases"}
_OUTPUT = {"expression", "unit"}
_CONSTANT = {"value", "unit", "note"}


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
    definitions: dict[str, Output]
    tables: dict[str, TableFunction]
    initial: dict[str, RecordValue]
    biases: dict[str, RecordValue]


def from_plain(content: Mapping[str, object]) -> tuple[Description, tuple[ModelBlock, ...]]:
    """Read the tables of a state-space model.

    Parameters
    ----------
    content : mapping
        As a TOML file gives it; formulas may be SymPy objects.

    Returns
    -------
    tuple
        Arguments of the model without its blocks, and the blocks.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type.
    """
    require_keys(content, _KEYS, "the model")
    states = read_texts(read_table(content, "states", required=False), "states")
    trim = read_table(content, "trim", required=False)
    described = Description(
        states=states,
        input_units=read_texts(read_table(content, "inputs"), "inputs"),
        measurements={
            name: _output(name, item, states)
            for name, item in read_table(content, "outputs").items()
        },
        equations=_formulas(content, "equations", required=bool(states)),
        parameters=_parameters(content),
        delays=_formulas(content, "delays", required=False),
        trim={name: read_number(value, f"trim.{name}") for name, value in trim.items()},
        pairs=_pairs(content.get("responses", [])),
        name=read_text(content.get("name", "state space"), "name"),
        source=read_text(content.get("source", ""), "source"),
        note=read_text(content.get("note", ""), "note"),
        definitions={
            name: _definition(name, item) for name, item in _optional(content, "definitions")
        },
        tables={
            name: read_table_function(name, item) for name, item in _optional(content, "tables")
        },
        initial=_record_values(content, "initial"),
        biases=_record_values(content, "biases"),
    )
    return described, tuple(read_block(name, item) for name, item in _optional(content, "blocks"))


def _optional(content: Mapping[str, object], key: str) -> list[tuple[str, object]]:
    return list(read_table(content, key, required=False).items())


def _record_values(content: Mapping[str, object], key: str) -> dict[str, RecordValue]:
    items = _optional(content, key)
    return {name: read_record_value(f"{key}.{name}", item) for name, item in items}


def _definition(name: str, item: object) -> Output:
    if not isinstance(item, dict):
        raise ModelError(
            f"definition {name} has no unit",
            found=repr(item)[:80],
            needed='{ expression = "...", unit = "..." }',
        )
    require_keys(item, _OUTPUT, f"definition {name}")
    expression = _formula(item.get("expression"), f"definitions.{name}.expression")
    return Output(expression, read_text(item.get("unit", "1"), f"definitions.{name}.unit"))


def _formula(item: object, subject: str) -> str:
    """A formula as text, or written from a SymPy object."""
    if is_sympy(item):
        return sympy_formula(item, subject)
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


def to_plain(model: Linearisation) -> dict[str, object]:
    """Plain values that `from_plain` reads.

    Parameters
    ----------
    model : Linearisation

    Returns
    -------
    dict
    """
    bare = model.bare or model
    content: dict[str, object] = {
        "kind": "state-space",
        "name": model.name,
        "states": dict(bare.states),
        "inputs": dict(bare.input_units),
        "outputs": _plain_outputs(bare.measurements),
        "parameters": {name: _plain(item) for name, item in model.parameters.items()},
        "equations": dict(bare.equations),
        "delays": {name: delay for name, delay in bare.delays.items() if delay != "0"},
        "trim": dict(model.trim),
        "responses": list(model.pairs),
        "source": model.source,
        "note": model.note,
    }
    further: dict[str, dict[str, object]] = {
        "definitions": _plain_outputs(bare.definitions),
        "tables": {name: table.to_dict() for name, table in model.tables.items()},
        "blocks": {block.name: block.to_dict() for block in model.blocks},
        "initial": {name: item.to_dict() for name, item in model.initial.items()},
        "biases": {name: item.to_dict() for name, item in model.biases.items()},
    }
    return content | {key: table for key, table in further.items() if table}


def _plain_outputs(outputs: Mapping[str, Output]) -> dict[str, object]:
    return {
        name: {"expression": output.expression, "unit": output.unit}
        for name, output in outputs.items()
    }


def _plain(parameter: Parameter) -> dict[str, object]:
    return {key: value for key, value in parameter.to_dict().items() if value is not None}


def lines(model: Linearisation) -> list[str]:
    """Equations, definitions, outputs, delays and blocks as text, one a line.

    Parameters
    ----------
    model : Linearisation

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
    definitions = [
        f"{name} = {output.expression} [{output.unit}]"
        for name, output in model.definitions.items()
    ]
    blocks = [f"block {block.shown()}" for block in model.blocks]
    return [*equations, *definitions, *outputs, *delays, *blocks]


def one_line(model: Linearisation) -> str:
    """Name and size of a model.

    Parameters
    ----------
    model : Linearisation

    Returns
    -------
    str
    """
    counts = {"state": model.states, "input": model.inputs, "output": model.outputs}
    sizes = [f"{len(x)} {word}{'' if len(x) == 1 else 's'}" for word, x in counts.items()]
    parameters = f"{len(model.parameters)} parameters, {len(model.parameters.free)} free"
    return f"StateSpaceModel({model.name!r}, {', '.join(sizes)}, {parameters})"
