"""Innovations models as plain values, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flightid.models.innovations.form import InnovationsForm
from flightid.models.language.reading import (
    read_list,
    read_matrix,
    read_names,
    read_number,
    read_operating_point,
    read_table,
    read_text,
    read_texts,
    require_keys,
)

SCHEMA = "flightid.innovations_model/1"
_KEYS = {"schema", "kind", "name", "outputs", "inputs", "sample_time_s", "units"}
_KEYS |= {"a", "b", "c", "d", "k", "noise_covariance", "operating_point"}


def innovations_to_table(model: InnovationsForm) -> dict[str, object]:
    """Plain values of a model; what is absent is left out, as TOML has no null."""
    table: dict[str, object] = {
        "schema": SCHEMA,
        "kind": "innovations",
        "name": model.name,
        "outputs": list(model.outputs),
        "inputs": list(model.inputs),
        "sample_time_s": model.sample_time_s,
        **{x: m.tolist() for x, m in zip("abcdk", model.matrices, strict=True)},
        "units": dict(model.units),
        "operating_point": {name: float(x) for name, x in model.operating_point.items()},
    }
    if model.noise_covariance is not None:
        table["noise_covariance"] = np.asarray(model.noise_covariance).tolist()
    return table


def innovations_from_table(content: Mapping[str, object]) -> dict[str, Any]:
    """Arguments of `InnovationsModel` from plain values.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type, or the matrices do not fit.
    """
    require_keys(content, _KEYS, "the innovations model")
    outputs, inputs = (read_names(content, key) for key in ("outputs", "inputs"))
    n, m, p = len(read_list(content.get("a", []), "a")), len(inputs), len(outputs)
    shapes = {"a": (n, n), "b": (n, m), "c": (p, n), "d": (p, m), "k": (n, p)}
    made: dict[str, Any] = {
        key: read_matrix(content.get(key), key, shape) for key, shape in shapes.items()
    }
    if "noise_covariance" in content:
        made["noise_covariance"] = read_matrix(
            content["noise_covariance"], "noise_covariance", (p, p)
        )
    return {
        **made,
        "outputs": outputs,
        "inputs": inputs,
        "sample_time_s": read_number(content.get("sample_time_s"), "sample_time_s"),
        "units": read_texts(read_table(content, "units", required=False), "units"),
        "name": read_text(content.get("name", "innovations model"), "name"),
        "operating_point": read_operating_point(content),
    }
