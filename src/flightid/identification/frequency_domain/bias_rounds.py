"""Rounds of fit and correction, for fits whose search does not hold the estimator itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.identification.frequency_domain.bias_findings import (
    ENOUGH,
    TOLERABLE,
    BiasOutcome,
)
from flightid.identification.frequency_domain.estimator_bias import (
    OUTSIDE,
    Correction,
    why_unknown,
)
from flightid.models import GreyBoxModel
from flightid.responses import FrequencyResponse

Array = NDArray[np.float64]

RELATIVE = 1e-7
"""Largest relative move in the last round where standard errors are not known."""
MOST_ROUNDS = 20
LARGEST_SHARE = 5.0
"""Largest step beyond a fit, in moves; two moves that suggest more suggest nothing."""


@dataclass(frozen=True)
class BiasRounds:
    """How the correction went.

    Attributes
    ----------
    model : GreyBoxModel
        The model after the last round.
    data : FrequencyResponse
        The response that the last fit saw.
    rounds : int
    move : float
        Largest move of a parameter in the last round, in standard errors.
    reason : str
        Why nothing was corrected; empty where it was.
    """

    model: GreyBoxModel
    data: FrequencyResponse
    rounds: int
    move: float
    reason: str = ""

    @property
    def outcome(self) -> BiasOutcome:
        """How it went, as every correction tells it."""
        return BiasOutcome(self.reason, not why_unknown(self.data), self.rounds, self.move)


def iterate(
    first: GreyBoxModel,
    correction: Correction,
    scales: Mapping[str, float],
    refit: Callable[[GreyBoxModel, FrequencyResponse], GreyBoxModel],
) -> BiasRounds:
    """Correct by the fitted model and fit again, until the parameters stand still.

    Parameters
    ----------
    first : GreyBoxModel
        Fitted to the response as it was measured.
    correction : Correction
        Of the response as measured.
    scales : mapping of str to float
        Standard errors by parameter.
    refit : callable
        Fits the model, from its values, to a corrected response.

    Returns
    -------
    BiasRounds
        With `first` and the measured response themselves where nothing could be corrected.
    """
    data = correction.data
    reason = why_unknown(data)
    if reason:
        return BiasRounds(first, data, 0, 0.0, reason)
    model, corrected, move, rounds = first, data, np.inf, 0
    moved, before = first, None
    try:
        while move > ENOUGH and rounds < MOST_ROUNDS:
            corrected = correction.apply(model)
            moved = refit(model, corrected)
            move, rounds = _move(model, moved, scales), rounds + 1
            here = (_scaled(model, scales), _scaled(moved, scales))
            model, before = _ahead(moved, before, here, scales), here
    except (FitError, *OUTSIDE) as error:
        return BiasRounds(first, data, rounds, move, str(error))
    if move > TOLERABLE:
        reason = f"the rounds did not settle: {move:.2g} standard errors in the last of {rounds}"
        return BiasRounds(first, data, rounds, move, reason)
    return BiasRounds(moved, corrected, rounds, move)


def _scaled(model: GreyBoxModel, scales: Mapping[str, float]) -> Array:
    return np.array([(p.value or 0.0) / scales.get(p.name, 1.0) for p in model.parameters.free])


def _ahead(
    moved: GreyBoxModel,
    before: tuple[Array, Array] | None,
    here: tuple[Array, Array],
    scales: Mapping[str, float],
) -> GreyBoxModel:
    """Where to correct from next: beyond the last fit, as far as the last two moves suggest.

    Rounds alone shrink a move by a constant factor, near one where the records say little of a
    parameter; the secant through two rounds leaves that factor behind.

    Reference
    ---------
    Walker & Ni, "Anderson acceleration for fixed-point iterations", *SIAM J. Numerical Analysis* 49
    (2011), with a depth of one.
    """
    if before is None:
        return moved
    last, now = before[1] - before[0], here[1] - here[0]
    change = now - last
    power = float(change @ change)
    share = float(now @ change) / power if power > 0.0 else 0.0
    if not abs(share) <= LARGEST_SHARE:
        return moved
    aim = here[1] - share * (here[1] - before[1])
    return moved.with_values(
        {
            p.name: float(np.clip(value * scales.get(p.name, 1.0), p.minimum, p.maximum))
            for p, value in zip(moved.parameters.free, aim, strict=True)
        }
    )


def _move(before: GreyBoxModel, after: GreyBoxModel, scales: Mapping[str, float]) -> float:
    found = 0.0
    for parameter in after.parameters.free:
        new, old = parameter.value or 0.0, before.parameters[parameter.name].value or 0.0
        scale = scales.get(parameter.name) or RELATIVE / ENOUGH * max(abs(new), abs(old))
        if new != old:
            found = max(found, abs(new - old) / scale)
    return found
