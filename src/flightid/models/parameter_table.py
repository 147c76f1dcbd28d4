"""A parameter from the table that describes it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from flightid.errors import ModelError
from flightid.models.language.reading import read_number, read_text, require_keys
from flightid.models.parameters import Parameter

PARAMETER_KEYS = {"value", "unit", "min", "max", "fixed", "tie", "note", "status"}


def read_parameter(name: str, item: object, ties: Mapping[str, str]) -> Parameter:
    """A parameter from its table, or from its value alone.

    Raises
    ------
    ModelError
        A key is unknown or of the wrong type, or the numbers contradict each other.
    """
    if not isinstance(item, dict):
        item = {"value": item}
    require_keys(item, PARAMETER_KEYS, f"parameter {name}")
    fixed = item.get("fixed", item.get("status") == "fixed")
    if not isinstance(fixed, bool):
        raise ModelError(f"parameters.{name}.fixed must be true or false", found=repr(fixed)[:80])
    tie = ties.get(name, item.get("tie"))

    def bound(key: str, default: float) -> float:
        value = item.get(key)
        return default if value is None else read_number(value, f"parameters.{name}.{key}")

    value = item.get("value")
    return Parameter(
        name,
        None if value is None else read_number(value, f"parameters.{name}.value"),
        read_text(item.get("unit", "1"), f"parameters.{name}.unit"),
        minimum=bound("min", -math.inf),
        maximum=bound("max", math.inf),
        free=not fixed,
        tie=None if tie is None else read_text(tie, f"parameters.{name}.tie"),
        note=read_text(item.get("note", ""), f"parameters.{name}.note"),
    )
