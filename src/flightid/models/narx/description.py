"""NARX equations as plain values, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

from flightid.errors import FlightidError, ModelError
from flightid.models.language.reading import (
    MAXIMUM_ENTRIES,
    read_number,
    read_table,
    read_text,
    require_keys,
)
from flightid.models.narx.model import NarxEquation, NarxModel, Scaling
from flightid.models.narx.terms import Lag, Term

SCHEMA = "flightid.narx_equation/1"
_KEYS = {"schema", "kind", "structure", "terms", "scaling", "units"}
_TERM_KEYS = {"name", "weight", "factors", "centre"}
_SCALING_KEYS = {"mean", "deviation", "sample_time_s", "output_range"}
_NUMBERS = {"width", "goal", "penalty", "held_back", "guard"}
_COUNTS = {"output_lags", "input_lags", "delay", "n_candidates", "seed", "degree", "maximum_terms"}


def narx_to_table(equation: NarxEquation) -> dict[str, object]:
    """Plain values of a NARX equation."""
    structure = {**asdict(equation.model), "inputs": list(equation.model.inputs)}
    structure["kernel"] = structure["kernel"] or "none"
    scaling = equation.scaling
    return {
        "schema": SCHEMA,
        "kind": "narx",
        "structure": structure,
        "terms": [
            {
                "name": term.name,
                "weight": float(weight),
                "factors": [[lag.channel, lag.lag, power] for lag, power in term.factors],
                "centre": [float(each) for each in term.centre],
            }
            for term, weight in zip(equation.terms, equation.weights, strict=True)
        ],
        "scaling": {
            "mean": {name: float(value) for name, value in scaling.mean.items()},
            "deviation": {name: float(value) for name, value in scaling.deviation.items()},
            "sample_time_s": float(scaling.sample_time_s),
            "output_range": [float(each) for each in scaling.output_range],
        },
        "units": dict(scaling.units),
    }


def narx_from_table(content: Mapping[str, object]) -> NarxEquation:
    """NARX equation from plain values.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type, or the values contradict each other.
    """
    require_keys(content, _KEYS, "the NARX equation")
    try:
        structure = _structure(read_table(content, "structure"))
    except FlightidError as error:
        raise ModelError("the structure makes no NARX model", found=str(error)) from error
    channels = (structure.output, *structure.inputs)
    described = _list(content.get("terms", []), "terms")
    terms = [_term(each, structure) for each in described]
    scale = read_table(content, "scaling")
    require_keys(scale, _SCALING_KEYS, "scaling")
    units = read_table(content, "units")
    parts = {key: read_table(scale, key) for key in ("mean", "deviation")}
    for name in channels:
        for key, table in {**parts, "units": units}.items():
            if name not in table:
                raise ModelError(f"{key} of channel {name} is missing")
    low, high = _pair(scale.get("output_range"))
    return NarxEquation(
        structure,
        tuple(term for term, _ in terms),
        tuple(weight for _, weight in terms),
        Scaling(
            {name: read_number(parts["mean"][name], "mean") for name in channels},
            {name: _positive(parts["deviation"][name], "deviation") for name in channels},
            {name: read_text(units[name], "units") for name in channels},
            _positive(scale.get("sample_time_s"), "sample_time_s"),
            (low, high),
        ),
    )


def _structure(table: Mapping[str, object]) -> NarxModel:
    known = {field.name for field in fields(NarxModel)}
    require_keys(table, known, "structure")
    made: dict[str, Any] = {}
    for key, item in table.items():
        subject = f"structure.{key}"
        if key == "inputs":
            made[key] = tuple(read_text(each, subject) for each in _list(item, subject))
        elif key in _NUMBERS:
            made[key] = read_number(item, subject)
        elif key in _COUNTS:
            made[key] = _count(item, subject)
        elif key in ("constant", "linear"):
            if not isinstance(item, bool):
                raise ModelError(f"{subject} must be true or false", found=repr(item)[:80])
            made[key] = item
        else:
            made[key] = read_text(item, subject)
    if made.get("kernel") == "none":
        made["kernel"] = None
    missing = {"output", "inputs", "output_lags", "input_lags"} - set(made)
    if missing:
        raise ModelError("the structure lacks keys", found=", ".join(sorted(missing)))
    return NarxModel(**made)


def _term(item: object, model: NarxModel) -> tuple[Term, float]:
    if not isinstance(item, dict):
        raise ModelError("a term must be a table", found=repr(item)[:80])
    require_keys(item, _TERM_KEYS, "a term")
    factors = []
    for each in _list(item.get("factors", []), "factors"):
        triple = _list(each, "factors")
        if len(triple) != 3:
            raise ModelError("a factor is channel, lag and power", found=repr(each)[:80])
        lag = Lag(read_text(triple[0], "factors"), _count(triple[1], "factors"))
        if lag not in model.lags:
            raise ModelError("a term has a lag outside the model", found=str(lag))
        factors.append((lag, _count(triple[2], "factors")))
    centre = tuple(read_number(each, "centre") for each in _list(item.get("centre", []), "centre"))
    if centre and (len(centre) != len(model.lags) or factors or model.kernel is None):
        raise ModelError(
            "a centre does not fit the lags", found=len(centre), needed=len(model.lags)
        )
    name = read_text(item.get("name", "term"), "name")
    return Term(name, tuple(factors), centre), read_number(item.get("weight"), "weight")


def _list(item: object, subject: str) -> list[Any]:
    if not isinstance(item, list) or len(item) > MAXIMUM_ENTRIES:
        raise ModelError(
            f"{subject} must be a list of at most {MAXIMUM_ENTRIES}", found=repr(item)[:80]
        )
    return item


def _count(item: object, subject: str) -> int:
    if isinstance(item, bool) or not isinstance(item, int) or not 0 <= item <= 1_000_000:
        raise ModelError(f"{subject} must be a count", found=repr(item)[:80])
    return item


def _positive(item: object, subject: str) -> float:
    value = read_number(item, subject)
    if not 0.0 < value < 1e300:
        raise ModelError(f"{subject} must be above zero", found=value)
    return value


def _pair(item: object) -> tuple[float, float]:
    listed = _list(item, "output_range")
    if len(listed) != 2:
        raise ModelError("output_range must be two numbers", found=repr(item)[:80])
    low, high = (read_number(each, "output_range") for each in listed)
    return low, high
