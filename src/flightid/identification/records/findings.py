"""Verdicts on records before a time-domain fit, and on the fit after it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.identification.records.setup import RecordSet
from flightid.uncertainty.residual_colour import Colour, colour_findings

ROUNDING_PERCENT = 1e-18
"""Share of an output's variance below which residuals are rounding."""
GOOD_PERCENT, POOR_PERCENT = 10.0, 40.0
_SOME = 0.01
"""Share of a cost from which on what noise makes of it is worth a word."""
_STILL = 1e-12


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


def judge_fit(
    costs: Mapping[str, float],
    colour: Colour,
    noise: Callable[[], Mapping[str, float]] | None = None,
) -> list[Finding]:
    """Verdicts on what the model explains, the worst first, and on the colour of the residuals.

    Parameters
    ----------
    costs : mapping of str to float
        Percent of each output's variance in the residuals.
    colour : Colour
        Ratios of standard errors to those for white residuals, and for noise of one power.
    noise : callable, optional
        Gives the percent that white noise of the measurements makes, which is no misfit; asked
        where more is left of an output than may be misfit.
    """
    asked = noise is not None and max(costs.values(), default=0.0) > GOOD_PERCENT
    known = noise() if noise is not None and asked else {}
    made = {name: min(cost, known.get(name, 0.0)) for name, cost in costs.items()}
    found = []
    # A check tells its first finding: of outputs with one light that is the worst.
    for name in sorted(costs, key=lambda name: made[name] - costs[name]):
        cost, by_noise = costs[name], made[name]
        missed = cost - by_noise
        light = (
            Light.GREEN
            if missed <= GOOD_PERCENT
            else Light.AMBER
            if missed <= POOR_PERCENT
            else Light.RED
        )
        words = f"{name}: {cost:.3g} % of its variance is left in the residuals"
        if cost > GOOD_PERCENT and by_noise > _SOME * cost:
            words += f", of which white noise of the measurements makes {by_noise:.3g} %"
        action = "look at the residuals: add dynamics, check signs and units, or it is noise"
        found.append(
            Finding("output-unexplained", light, words, "" if light is Light.GREEN else action)
        )
    # What rounding leaves has a colour that says nothing of noise.
    if max(costs.values(), default=0.0) < ROUNDING_PERCENT:
        return found
    return [*found, *colour_findings(*colour)]
