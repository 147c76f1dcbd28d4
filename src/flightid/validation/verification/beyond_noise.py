"""Errors within the guide that are many times the measurement's noise, and that inputs foretell.

A coefficient within its guide says that a prediction is of use, not that it is right: in calm air a
derivative may be a third off below it. What inputs foretell of an error no gust made.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.identification.prediction.request import FREE_RUN
from flightid.identification.prediction.result import Prediction
from flightid.identification.records.white_noise import white_levels
from flightid.validation.verification.foretold_error import chances_by_output

CODE = "verification-foretold"
TIMES = 3.0
"""Errors over the white noise of the measurement from which noise is no account of them."""
MATERIAL = 0.01
"""Share of an output's variance below which what a model lacks is slight: it explains 99 %."""
FALSE_ALARMS = 0.001
"""Chance of as much in a right model."""


def foretold_findings(
    made: Sequence[Prediction],
    outputs: Sequence[str],
    innovations: Sequence[NDArray[np.float64]] = (),
) -> tuple[Finding, ...]:
    """Amber for each output whose error noise does not explain and inputs foretell.

    Parameters
    ----------
    made : sequence of Prediction
    outputs : sequence of str
        Of which nothing worse is said.
    innovations : sequence of ndarray, shape (n_outputs, n_samples), optional
        Of each record, asked in place of errors (`chances_by_output`).

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 16.6.
    """
    if any(each.horizon != FREE_RUN or each.diverged_at is not None for each in made):
        return ()
    times = {name: _times_the_noise(made, name) for name in outputs}
    large = [name for name, each in times.items() if each is not None]
    chances = chances_by_output(made, innovations) if large else {}
    return tuple(
        Finding(
            CODE,
            Light.AMBER,
            f"{name}: errors are {times[name]:.2g} times the white noise of its measurement, and "
            f"inputs foretell some of them (p = {chances[name]:.1g}): within the guide, yet the "
            "model answers inputs otherwise than the vehicle",
            f"flightid verify --residual-tests, and look for what {name} lacks: an input's gain, a "
            "derivative, a lag, a delay, how inputs are held",
        )
        for name in large
        if chances.get(name, 1.0) < FALSE_ALARMS
    )


def _times_the_noise(made: Sequence[Prediction], name: str) -> float | None:
    """Deviation of the error over that of white noise; None where noise or 1 % explain it."""
    pairs = [each.scored(name) for each in made]
    try:
        levels = [float(white_levels(y[None, :])[0]) for y, _ in pairs]
    except DataError:
        return None
    y, y_hat = (np.concatenate([pair[side] for pair in pairs]) for side in (0, 1))
    noise = float(np.average(np.square(levels), weights=[len(pair[0]) for pair in pairs]))
    # About means: a level that is off is no answer to inputs.
    error, moved = float(np.var(y - y_hat)), float(np.var(y))
    if not (error > TIMES**2 * noise > 0.0 and error > MATERIAL * moved):
        return None
    return float(np.sqrt(error / noise))
