"""Rounds of fit and correction, until the parameters stand still."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import DataError, FitError, ModelError, SingularError
from flightid.findings import Finding
from flightid.identification.frequency_domain.error_model import ErrorModel
from flightid.identification.frequency_domain.estimator_bias import Correction, why_unknown
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.models import GreyBoxModel
from flightid.responses import FrequencyResponse

Array = NDArray[np.float64]

ENOUGH = 1e-3
"""Largest move of a parameter in the last round, in standard errors."""
TOLERABLE = 0.1
"""Largest such move at which a correction that ran out of rounds is still kept."""
RELATIVE = 1e-7
"""Largest relative move in the last round where standard errors are not known."""
MOST_ROUNDS = 20
LARGEST_SHARE = 5.0
"""Largest step beyond a fit, in moves; two moves that suggest more suggest nothing."""
_DECIBEL = 20.0 / np.log(10.0)
_DEGREE = 180.0 / np.pi


@dataclass(frozen=True)
class Size:
    """Size of a correction over the fitted points of one response, root mean squares.

    Attributes
    ----------
    magnitude_db, phase_deg : float
    standard_errors : float or None
        Size over the standard error of the point; None where that is not known.
    """

    magnitude_db: float
    phase_deg: float
    standard_errors: float | None


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
    contraction : float
        Move of the second round over that of the first: how much the correction itself
        follows the parameters.
    """

    model: GreyBoxModel
    data: FrequencyResponse
    rounds: int
    move: float
    reason: str = ""
    contraction: float = 0.0

    @property
    def applied(self) -> bool:
        """Whether the response was corrected."""
        return not self.reason

    @property
    def converged(self) -> bool:
        """Whether the parameters stood still."""
        return self.applied and self.move <= ENOUGH


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
    moves: list[float] = []
    try:
        while move > ENOUGH and rounds < MOST_ROUNDS:
            corrected = correction.apply(model)
            moved = refit(model, corrected)
            move, rounds = _move(model, moved, scales), rounds + 1
            here = (_scaled(model, scales), _scaled(moved, scales))
            model, before = _ahead(moved, before, here, scales), here
            moves.append(move)
    except (DataError, ModelError, FitError, SingularError) as error:
        return BiasRounds(first, data, rounds, move, str(error))
    if move > TOLERABLE:
        reason = f"the rounds did not settle: {move:.2g} standard errors in the last of {rounds}"
        return BiasRounds(first, data, rounds, move, reason)
    # The first two rounds are plain: later ones are led ahead of what they would have done.
    contraction = moves[1] / moves[0] if len(moves) > 1 else 0.0
    return BiasRounds(moved, corrected, rounds, move, contraction=contraction)


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


def sizes(
    before: Sequence[SelectedResponse], after: Sequence[SelectedResponse], errors: ErrorModel
) -> dict[str, Size]:
    """Size of the correction by response."""
    result, variances = {}, _variances(before, errors)
    for one, other, variance in zip(before, after, variances, strict=True):
        ratio = np.log(one.response / other.response)
        distance = np.abs(one.response - other.response)
        share = None
        if variance is not None and np.all(variance > 0.0):
            share = float(np.sqrt(np.mean(distance**2 / variance)))
        result[one.name] = Size(
            float(np.sqrt(np.mean((_DECIBEL * ratio.real) ** 2))),
            float(np.sqrt(np.mean((_DEGREE * ratio.imag) ** 2))),
            share,
        )
    return result


def _variances(selected: Sequence[SelectedResponse], errors: ErrorModel) -> list[Array | None]:
    """Variance of each complex point, by response."""
    result: list[Array | None] = []
    for run, covariance in zip(errors.runs, errors.covariances, strict=True):
        diagonal = np.diag(covariance)
        both = diagonal[: len(diagonal) // 2] + diagonal[len(diagonal) // 2 :]
        counts = [len(each.places) for each in selected[run.first : run.first + run.count]]
        result += np.split(both, np.cumsum(counts)[:-1])
    return result or [None] * len(selected)


def judge_bias(done: BiasRounds, found: Mapping[str, Size]) -> list[Finding]:
    """Verdict on the correction: what it did, or why there was none."""
    if not done.applied:
        return [
            Finding(
                "estimator-bias-not-corrected",
                Light.UNKNOWN,
                f"leakage and resolution of the estimate were not corrected: {done.reason}",
                "fit a response that was estimated from records, and widen the windows",
            )
        ]
    texts = []
    for name, size in found.items():
        errors = size.standard_errors
        share = "" if errors is None else f", {errors:.2g} standard errors"
        texts.append(f"{name} {size.magnitude_db:.2g} dB and {size.phase_deg:.2g}°{share}")
    light = Light.GREEN if done.converged else Light.AMBER
    end = "" if done.converged else f"; the last moved by {done.move:.2g} standard errors"
    return [
        Finding(
            "estimator-bias",
            light,
            f"estimator's leakage and resolution, taken out in {done.rounds} rounds{end} (rms): "
            + "; ".join(texts),
            "" if done.converged else "widen the windows or simplify the model",
        )
    ]


def provenance(done: BiasRounds, found: Mapping[str, Size], hold: str) -> dict[str, object]:
    """Plain values of what was done."""
    return {
        "applied": done.applied,
        "reason": done.reason,
        "hold": hold,
        "rounds": done.rounds,
        "converged": done.converged,
        "responses": {name: vars(size).copy() for name, size in found.items()},
    }
