"""Polynomial models as plain values, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flightid.errors import ModelError
from flightid.models.language.reading import (
    MAXIMUM_ENTRIES,
    read_number,
    read_operating_point,
    read_table,
    read_text,
    read_texts,
    require_keys,
)
from flightid.models.polynomial.polynomials import Polynomials
from flightid.models.polynomial.structure import SEPARATE

SCHEMA = "flightid.polynomial_model/1"
_KEYS = {"schema", "kind", "name", "output", "inputs", "sample_time_s", "a", "c", "d", "units"}
_KEYS |= {"noise_variance", "covariance", "operating_point", "denominators"}
_INPUT_KEYS = {"b", "f", "nk"}


def model_to_table(model: Polynomials) -> dict[str, object]:
    """Plain values of a model; what is absent is left out, as TOML has no null."""

    def plain(row: object) -> list[float]:
        return [float(value) for value in np.asarray(row, dtype=np.float64)]

    table: dict[str, object] = {
        "schema": SCHEMA,
        "kind": "polynomial",
        "name": model.name,
        "output": model.output,
        "sample_time_s": float(model.sample_time_s),
        "a": plain(model.a),
        "c": plain(model.c),
        "d": plain(model.d),
        "inputs": {
            name: {"b": plain(model.b[i]), "f": plain(model.f[i]), "nk": int(model.nk[i])}
            for i, name in enumerate(model.inputs)
        },
        "units": dict(model.units),
        "operating_point": {name: float(value) for name, value in model.operating_point.items()},
    }
    if model.denominators != SEPARATE:
        table["denominators"] = model.denominators
    if model.noise_variance is not None:
        table["noise_variance"] = float(model.noise_variance)
    if model.covariance is not None:
        table["covariance"] = [plain(row) for row in model.covariance]
    return table


def model_from_table(content: Mapping[str, object]) -> dict[str, Any]:
    """Arguments of `PolynomialModel` from plain values.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type.
    """
    require_keys(content, _KEYS, "the model")
    inputs = read_table(content, "inputs", required=False)
    for name, item in inputs.items():
        if not isinstance(item, dict):
            raise ModelError(f"inputs.{name} must be a table", found=repr(item)[:80])
        require_keys(item, _INPUT_KEYS, f"inputs.{name}")
    for key in ("output", "sample_time_s"):
        if key not in content:
            raise ModelError(f"the model has no {key}")
    made: dict[str, Any] = {
        "output": read_text(content["output"], "output"),
        "inputs": tuple(inputs),
        "sample_time_s": read_number(content["sample_time_s"], "sample_time_s"),
        "b": [_numbers(item.get("b", []), f"inputs.{name}.b") for name, item in inputs.items()],
        "f": [_numbers(item.get("f", [1.0]), f"inputs.{name}.f") for name, item in inputs.items()],
        "nk": tuple(_delay(item.get("nk", 1), name) for name, item in inputs.items()),
        "units": read_texts(read_table(content, "units", required=False), "units"),
        "name": read_text(content.get("name", "polynomial model"), "name"),
        "operating_point": read_operating_point(content),
        "denominators": read_text(content.get("denominators", SEPARATE), "denominators"),
    }
    for letter in "acd":
        made[letter] = _numbers(content.get(letter, [1.0]), letter)
    if "noise_variance" in content:
        made["noise_variance"] = read_number(content["noise_variance"], "noise_variance")
    if "covariance" in content:
        rows = content["covariance"]
        if not isinstance(rows, list):
            raise ModelError("covariance must be a list of rows", found=repr(rows)[:80])
        made["covariance"] = np.array([_numbers(row, "covariance") for row in rows])
    return made


def _numbers(item: object, subject: str) -> list[float]:
    if not isinstance(item, list) or len(item) > MAXIMUM_ENTRIES:
        raise ModelError(
            f"{subject} must be a list of at most {MAXIMUM_ENTRIES} numbers", found=repr(item)[:80]
        )
    return [read_number(value, subject) for value in item]


def _delay(item: object, name: str) -> int:
    if isinstance(item, bool) or not isinstance(item, int) or item < 0:
        raise ModelError(f"inputs.{name}.nk must be a number of samples", found=repr(item)[:80])
    return item
