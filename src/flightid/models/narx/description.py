"""NARX models as plain values, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from flightid.errors import FlightidError, ModelError
from flightid.models.language.reading import (
    read_list,
    read_number,
    read_table,
    read_text,
    require_keys,
)
from flightid.models.narx.model import NarxModel
from flightid.models.narx.scaling import Scaling
from flightid.models.narx.structure import NarxStructure
from flightid.models.narx.terms import Lag, Term

_KEYS = {"schema", "kind", "name", "structure", "terms", "scaling", "units"}
_TERM_KEYS = {"name", "weight", "factors", "centre"}
_SCALING_KEYS = {"mean", "deviation", "sample_time_s", "output_range"}
_NUMBERS = {"width", "goal", "penalty", "held_back", "guard"}
_COUNTS = {"output_lags", "input_lags", "delay", "n_candidates", "seed", "degree", "maximum_terms"}


def narx_from_table(content: Mapping[str, object]) -> NarxModel:
    """NARX model from plain values.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type, or the values contradict each other.
    """
    require_keys(content, _KEYS, "the NARX model")
    try:
        structure = _structure(read_table(content, "structure"))
    except FlightidError as error:
        raise ModelError("the structure makes no NARX model", found=str(error)) from error
    channels = (structure.output, *structure.inputs)
    described = read_list(content.get("terms", []), "terms")
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
    return NarxModel(
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
        read_text(content.get("name", "NARX model"), "name"),
    )


def _structure(table: Mapping[str, object]) -> NarxStructure:
    known = {field.name for field in fields(NarxStructure)}
    require_keys(table, known, "structure")
    made: dict[str, Any] = {}
    for key, item in table.items():
        subject = f"structure.{key}"
        if key == "inputs":
            made[key] = tuple(read_text(each, subject) for each in read_list(item, subject))
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
    return NarxStructure(**made)


def _term(item: object, model: NarxStructure) -> tuple[Term, float]:
    if not isinstance(item, dict):
        raise ModelError("a term must be a table", found=repr(item)[:80])
    require_keys(item, _TERM_KEYS, "a term")
    factors = []
    for each in read_list(item.get("factors", []), "factors"):
        triple = read_list(each, "factors")
        if len(triple) != 3:
            raise ModelError("a factor is channel, lag and power", found=repr(each)[:80])
        lag = Lag(read_text(triple[0], "factors"), _count(triple[1], "factors"))
        if lag not in model.lags:
            raise ModelError("a term has a lag outside the model", found=str(lag))
        factors.append((lag, _count(triple[2], "factors")))
    centre = tuple(
        read_number(each, "centre") for each in read_list(item.get("centre", []), "centre")
    )
    if centre and (len(centre) != len(model.lags) or factors or model.kernel is None):
        raise ModelError(
            "a centre does not fit the lags", found=len(centre), needed=len(model.lags)
        )
    name = read_text(item.get("name", "term"), "name")
    return Term(name, tuple(factors), centre), read_number(item.get("weight"), "weight")


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
    listed = read_list(item, "output_range")
    if len(listed) != 2:
        raise ModelError("output_range must be two numbers", found=repr(item)[:80])
    low, high = (read_number(each, "output_range") for each in listed)
    return low, high
