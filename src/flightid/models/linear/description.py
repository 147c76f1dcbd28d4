"""Linear systems from plain values, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flightid.errors import FlightidError, ModelError
from flightid.models.language.reading import (
    read_list,
    read_matrix,
    read_names,
    read_number,
    read_table,
    read_text,
    read_texts,
    require_keys,
)
from flightid.models.linear.linear_system import LinearSystem

_KEYS = {"schema", "kind", "inputs", "outputs", "states", "sample_time_s", "delays_s", "units"}
_KEYS |= {"a", "b", "c", "d", "name"}


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
    n = len(states) or len(read_list(content.get("a", []), "a"))
    shapes = {"a": (n, n), "b": (n, len(inputs)), "c": (len(outputs), n)}
    shapes["d"] = (len(outputs), len(inputs))
    step = content.get("sample_time_s")
    delays = [
        read_number(each, "delays_s") for each in read_list(content.get("delays_s", []), "delays_s")
    ]
    matrices: dict[str, Any] = {
        key: read_matrix(content.get(key), key, shape) for key, shape in shapes.items()
    }
    try:
        return LinearSystem(
            **matrices,
            inputs=inputs,
            outputs=outputs,
            delays_s=delays,
            states=states,
            sample_time_s=None if step is None else read_number(step, "sample_time_s"),
            units=read_texts(read_table(content, "units", required=False), "units"),
            name=read_text(content.get("name", "linear system"), "name"),
        )
    except FlightidError as error:
        raise ModelError("the values do not make a linear system", found=str(error)) from error
