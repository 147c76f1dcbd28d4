"""Limits of an actuator where nobody told them: what the records' input went through."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from flightid.control.tuning.controller_options import ControllerOptions
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.models import Model
from flightid.units import DIMENSIONLESS

if TYPE_CHECKING:
    from flightid.study.identified import ModelResults

CODE = "limits-untold"
DIGITS = 4


def input_ranges(identified: Iterable[ModelResults]) -> dict[str, tuple[float, float]]:
    """Least and largest sample of every input in the records that its models were fitted to.

    Parameters
    ----------
    identified : iterable of ModelResults

    Returns
    -------
    dict of str to tuple of float
        By input, in its own unit; none where a model keeps no records.
    """
    found: dict[str, tuple[float, float]] = {}
    for item in identified:
        for record in item.training:
            for name in record.inputs:
                held = record[name][np.isfinite(record[name])]
                if held.size:
                    ends = (*found.get(name, ()), float(held.min()), float(held.max()))
                    found[name] = (_told(min(ends)), _told(max(ends)))
    return found


def _told(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def untold_limits(
    asked: ControllerOptions,
    input: str,
    model: Model,
    ranges: Mapping[str, tuple[float, float]],
) -> tuple[Finding, ...]:
    """What the records propose as limits of a controller that was given none.

    Parameters
    ----------
    asked : ControllerOptions
    input : str
        What the controller moves.
    model : model
    ranges : mapping of str to tuple of float
        Of `input_ranges`.

    Example
    -------
    >>> import flightid as fid
    >>> model = fid.load_model("rate_first_order")
    >>> seen = {"tau_phi": (-1.0, 1.0)}
    >>> told = untold_limits(ControllerOptions(), "tau_phi", model, seen)
    >>> print(told[0].message)
    the controller's output has no limits; in the records tau_phi went from -1 to 1
    >>> untold_limits(ControllerOptions(output_low=-0.5), "tau_phi", model, seen)
    ()
    """
    if input not in ranges or not (asked.output_low is None and asked.output_high is None):
        return ()
    low, high = ranges[input]
    unit = getattr(model, "units", {}).get(input, DIMENSIONLESS)
    told = "" if unit == DIMENSIONLESS else f" {unit}"
    said = f"the controller's output has no limits; in the records {input} went from "
    return (
        Finding(
            CODE,
            Light.GREEN,
            f"{said}{low:g} to {high:g}{told}",
            f"tell those of the actuator, or take these as a proposal: output_low={low:g}, "
            f"output_high={high:g}; at them the integral is driven back",
        ),
    )
