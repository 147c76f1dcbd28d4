"""Verdicts on records before a time-domain fit, and on the fit after it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.identification.records.setup import RecordSet
from flightid.uncertainty.residual_covariance import colour_findings

ROUNDING_PERCENT = 1e-18
"""Share of an output's variance below which residuals are rounding."""
GOOD_PERCENT, POOR_PERCENT = 10.0, 40.0
_STILL = 1e-12
_DEGREES = 180.0 / np.pi


def judge_channels(prepared: RecordSet) -> list[Finding]:
    """Look at the channels before the fit.

    Raises
    ------
    DataError
        An output that never changes, or no input that does.
    """
    model = prepared.model
    moving = dict.fromkeys((*model.inputs, *model.outputs), False)
    for inputs, outputs, _ in prepared.arrays:
        for name, row in zip(moving, np.vstack([inputs, outputs]), strict=True):
            moving[name] |= bool(np.ptp(row) > _STILL * np.max(np.abs(row), initial=0.0))
    still = [name for name in model.outputs if not moving[name]]
    if still:
        raise DataError(
            "an output does not change in any record",
            found=", ".join(still),
            needed="a measured response",
            action="check the channel, or take the output out of the model",
        )
    quiet = [name for name in model.inputs if not moving[name]]
    if len(quiet) == len(model.inputs):
        raise DataError(
            "no input changes in any record",
            found=", ".join(quiet),
            needed="an input that excites the vehicle",
            action="take records of manoeuvres",
        )
    return [
        Finding(
            "input-not-excited",
            Light.AMBER,
            f"input {name} does not change in any record",
            "fix the parameters that belong to it, or add a record that moves it",
        )
        for name in quiet
    ]


def judge_fit(costs: Mapping[str, float], colour: tuple[float, float]) -> list[Finding]:
    """Verdicts on what the model explains, and on the colour of the residuals.

    `colour` is the smallest and the largest ratio of a standard error to that for white residuals.
    """
    found = []
    for name, cost in costs.items():
        light = (
            Light.GREEN
            if cost <= GOOD_PERCENT
            else Light.AMBER
            if cost <= POOR_PERCENT
            else Light.RED
        )
        found.append(
            Finding(
                "output-unexplained",
                light,
                f"{name}: {cost:.3g} % of its variance is left in the residuals",
                ""
                if light is Light.GREEN
                else "look at the residuals: add dynamics, check signs and units, or it is noise",
            )
        )
    # What rounding leaves has a colour that says nothing of noise.
    if max(costs.values(), default=0.0) < ROUNDING_PERCENT:
        return found
    return [*found, *colour_findings(*colour)]
