"""What a fit was told of initial states and biases: its model is predicted the same way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from flightid.models.model import model_of

WORDS = ("estimate", "measured", "trim")


@dataclass(frozen=True)
class Remembered:
    """What was told; None where nothing was.

    Attributes
    ----------
    initial_state : {"estimate", "measured", "trim"} or None
        Numbers by state belong to the records of the fit and are not carried on.
    output_bias, input_bias : bool or None
        Whether any was free.
    """

    initial_state: str | None = None
    output_bias: bool | None = None
    input_bias: bool | None = None


def remembered(source: object) -> Remembered:
    """What a fit, or the model in its file, was told; nothing for a model that no fit made.

    Example
    -------
    >>> remembered(object())
    Remembered(initial_state=None, output_bias=None, input_bias=None)
    """
    told = _told(source)
    start = told.get("initial_state")
    biases = {
        name: None if told.get(name) is None else bool(told[name])
        for name in ("output_bias", "input_bias")
    }
    return Remembered(start if start in WORDS else None, **biases)


def _told(source: object) -> Mapping[str, Any]:
    estimated = getattr(model_of(source), "estimated", None)
    for holder in (source, estimated):
        known = getattr(holder, "provenance", None)
        told = known.get("told") if isinstance(known, Mapping) else None
        if isinstance(told, Mapping):
            return told
    return {}
