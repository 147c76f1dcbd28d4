"""Linear systems, innovations models and NARX equations as plain values, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FlightidError, ModelError
from flightid.models.innovations.model import SCHEMA as INNOVATIONS_SCHEMA
from flightid.models.innovations.model import InnovationsModel
from flightid.models.language.reading import (
    MAXIMUM_ENTRIES,
    read_number,
    read_operating_point,
    read_table,
    read_text,
    read_texts,
    require_keys,
)
from flightid.models.linear.linear_system import LinearSystem

SCHEMA = "flightid.linear_system/1"
_KEYS = {"schema", "kind", "inputs", "outputs", "states", "sample_time_s", "delays_s", "units"}
_KEYS |= {"a", "b", "c", "d"}
_INNOVATIONS_KEYS = {"schema", "kind", "name", "outputs", "inputs", "sample_time_s", "units"}
_INNOVATIONS_KEYS |= {"a", "b", "c", "d", "k", "noise_covariance", "operating_point"}


def system_to_table(system: LinearSystem) -> dict[str, object]:
    """Plain values of a linear system; what is absent is left out, as TOML has no null.

    Example
    -------
    >>> lag = LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> system_to_table(lag)["a"]
    [[-5.0]]
    """
    a, b, c, d, delays = system.state_space()
    table: dict[str, object] = {
        "schema": SCHEMA,
        "kind": "linear",
        "inputs": list(system.inputs),
        "outputs": list(system.outputs),
        "states": list(system.states),
        "a": a.tolist(),
        "b": b.tolist(),
        "c": c.tolist(),
        "d": d.tolist(),
        "delays_s": delays.tolist(),
        "units": dict(system.units),
    }
    if system.sample_time_s is not None:
        table["sample_time_s"] = system.sample_time_s
    return table


def system_from_table(content: Mapping[str, object]) -> LinearSystem:
    """Linear system from plain values.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type, or the matrices do not fit.

    Example
    -------
    >>> system_from_table({"inputs": ["u"], "outputs": ["y"], "d": [[2.0]]})
    LinearSystem(0 states, inputs [u], outputs [y])
    """
    require_keys(content, _KEYS, "the linear system")
    inputs, outputs = (read_names(content, key) for key in ("inputs", "outputs"))
    states = read_names(content, "states") if "states" in content else ()
    n = len(states) or len(_list(content.get("a", []), "a"))
    shapes = {"a": (n, n), "b": (n, len(inputs)), "c": (len(outputs), n)}
    shapes["d"] = (len(outputs), len(inputs))
    step = content.get("sample_time_s")
    delays = [
        read_number(each, "delays_s") for each in _list(content.get("delays_s", []), "delays_s")
    ]
    try:
        return LinearSystem(
            **{key: read_matrix(content.get(key), key, shape) for key, shape in shapes.items()},
            inputs=inputs,
            outputs=outputs,
            delays_s=delays,
            states=states,
            sample_time_s=None if step is None else read_number(step, "sample_time_s"),
            units=read_texts(read_table(content, "units", required=False), "units"),
        )
    except FlightidError as error:
        raise ModelError("the values do not make a linear system", found=str(error)) from error


def innovations_from_table(content: Mapping[str, object]) -> InnovationsModel:
    """Innovations model from plain values.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type, or the matrices do not fit.
    """
    require_keys(content, _INNOVATIONS_KEYS, "the innovations model")
    outputs, inputs = (read_names(content, key) for key in ("outputs", "inputs"))
    n, m, p = len(_list(content.get("a", []), "a")), len(inputs), len(outputs)
    shapes = {"a": (n, n), "b": (n, m), "c": (p, n), "d": (p, m), "k": (n, p)}
    made: dict[str, Any] = {
        key: read_matrix(content.get(key), key, shape) for key, shape in shapes.items()
    }
    if "noise_covariance" in content:
        made["noise_covariance"] = read_matrix(
            content["noise_covariance"], "noise_covariance", (p, p)
        )
    return InnovationsModel(
        outputs,
        inputs,
        read_number(content.get("sample_time_s"), "sample_time_s"),
        **made,
        units=read_texts(read_table(content, "units", required=False), "units"),
        name=read_text(content.get("name", "innovations model"), "name"),
        operating_point=read_operating_point(content),
    )


def innovations_to_table(model: InnovationsModel) -> dict[str, object]:
    """Plain values of an innovations model without what is absent."""
    table = {key: value for key, value in model.to_dict().items() if value is not None}
    return {**table, "schema": INNOVATIONS_SCHEMA, "kind": "innovations"}


def read_names(content: Mapping[str, object], key: str) -> tuple[str, ...]:
    """A list of different names.

    Raises
    ------
    ModelError
        It is missing, no list of texts, or names something twice.
    """
    if key not in content:
        raise ModelError(f"the model has no {key}")
    listed = _list(content[key], key)
    names = tuple(read_text(each, key) for each in listed)
    if len(set(names)) < len(names):
        raise ModelError(f"a name is given twice among the {key}", found=", ".join(names)[:200])
    return names


def read_matrix(item: object, key: str, shape: tuple[int, int]) -> NDArray[np.float64]:
    """A matrix as a list of rows; zeros where it is absent.

    Raises
    ------
    ModelError
        It is no list of rows of numbers, or of another shape.
    """
    if item is None or 0 in shape:
        return np.zeros(shape)
    rows = [[read_number(x, key) for x in _list(row, key)] for row in _list(item, key)]
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        raise ModelError(
            f"matrix {key} does not fit the names",
            found=f"{len(rows)} rows of {sorted({len(row) for row in rows})}",
            needed=f"{shape[0]} rows of {shape[1]}",
        )
    return np.array(rows, dtype=np.float64)


def _list(item: object, key: str) -> list[object]:
    if not isinstance(item, list) or len(item) > MAXIMUM_ENTRIES:
        raise ModelError(
            f"{key} must be a list of at most {MAXIMUM_ENTRIES}", found=repr(item)[:80]
        )
    return item
