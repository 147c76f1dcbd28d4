"""From set-points and what followed to the closed loop between: a regularised long ARX model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.recursive_filter import filtered
from flightid.review.loop_predictors import LoopPredictor, predictors
from flightid.review.loop_samples import LoopSamples

Array = NDArray[np.float64]
MEMORY_S = (0.5, 0.1, 0.4)
"""Lags of the measured channel, of its forerunner and of the set-point, in units of `pace_s`."""
FEWEST_LAGS, MOST_LAGS = 4, 50
ROWS_PER_LAG = 10
DRAWS = 400
TOO_FEW = "too few samples"


@dataclass(frozen=True, eq=False)
class LoopDraws:
    """The closed loop as polynomials in the delay of one sample: the estimate, then draws of it.

    Attributes
    ----------
    numerators, denominators : ndarray, shape (1 + draws, n)
        Ascending powers; row 0 is the estimate.
    sample_time_s : float
    """

    numerators: Array
    denominators: Array
    sample_time_s: float

    def step(self, count: int) -> Array:
        """Answers to a step of the set-point at `count` samples, shape (1 + draws, count).

        Value k is what the loop reaches half a sample after sample k: the sum of smooth pulses.
        """
        ones = np.ones(count)
        rows = zip(self.numerators, self.denominators, strict=True)
        return np.array([filtered(b, a, ones) for b, a in rows])

    def instants(self, count: int, tick_s: float) -> Array:
        """When it has them, s, of a set-point that is held for ticks of `tick_s`.

        What is held acts half a tick later than what is smooth.
        """
        middles = (np.arange(count) + 0.5) * self.sample_time_s
        return np.asarray(middles - 0.5 * tick_s)

    def answers(self, samples: LoopSamples) -> list[Array]:
        """What the set-point alone makes the estimate do in each piece, from rest."""
        parts = np.split(samples.set_point, np.cumsum(samples.lengths)[:-1])
        return [filtered(self.numerators[0], self.denominators[0], part) for part in parts]

    def response(self, omega_rad_s: Array) -> NDArray[np.complex128]:
        """Frequency responses, shape (1 + draws, n_omega)."""
        delay = np.exp(-1j * omega_rad_s * self.sample_time_s)
        top, bottom = (
            polynomials @ delay ** np.arange(polynomials.shape[1])[:, None]
            for polynomials in (self.numerators, self.denominators)
        )
        return np.asarray(top / bottom)


def closed_loop(samples: LoopSamples, *, pace_s: float = 1.0, seed: int = 0) -> LoopDraws:
    """Estimate a closed loop from ordinary flying, with draws of what the data still allow.

    Gusts move the measured channel, the attitude loop answers, and the set-point follows: a plain
    quotient is bent by that. A long ARX model predicts the measured channel from its own past, from
    the set-point and from the forerunner, which knows of a gust before the filtered gyro does, and
    so leaves the noise out. The sum of errors stands for what an integrator remembers.

    Parameters
    ----------
    samples : LoopSamples
    pace_s : float
        What the memory is measured in: 1 for rate loops of a multirotor, longer for slower loops.
    seed : int
        Of the draws.

    Raises
    ------
    DataError
        Fewer than ten samples for each coefficient, or a channel that does not move.

    Assumes
    -------
    One linear loop throughout; a set-point that acts after a sample at the earliest; no common
    cause of set-point and motion that neither shows.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.4 (direct approach); Chen, Ohlsson & Ljung
    (2012), Automatica 48.
    """
    own, other, driven = (_lags(memory * pace_s, samples.sample_time_s) for memory in MEMORY_S)
    _require_rows(samples, own + other + driven)
    random = np.random.default_rng(seed)
    made = predictors(samples, (own, other, driven), DRAWS, random)
    return _polynomials([_Equation.rows(each) for each in made], samples.sample_time_s)


def _lags(memory_s: float, sample_time_s: float) -> int:
    return int(np.clip(round(memory_s / sample_time_s), FEWEST_LAGS, MOST_LAGS))


def _require_rows(samples: LoopSamples, coefficients: int) -> None:
    if np.ptp(samples.set_point) == 0.0 or np.ptp(samples.measured) == 0.0:
        raise DataError("the set-point or what was measured does not move at all")
    rows = sum(max(0, length - MOST_LAGS) for length in samples.lengths)
    if rows < ROWS_PER_LAG * coefficients:
        raise DataError(
            TOO_FEW,
            found=f"{samples.duration_s:.3g} s",
            needed=f"{(ROWS_PER_LAG * coefficients + MOST_LAGS) * samples.sample_time_s:.3g} s "
            "in one piece",
        )


def _polynomials(equations: Sequence[Sequence[_Equation]], sample_time_s: float) -> LoopDraws:
    """Closed loops of predictors: what a set-point does to the first channel by way of all.

    All times what makes differences of sums, which takes the infinite memory of these away.
    """
    made = []
    for one, *others in zip(*equations, strict=True):
        a, b = one.differences(one.past), one.differences(_delayed(one.driven))
        for two in others:
            driven, back = two.differences(_delayed(two.driven)), two.differences(two.through, -1.0)
            b = _sum(np.convolve(two.past, b), np.convolve(one.through, driven))
            a = _sum(np.convolve(two.past, a), -np.convolve(one.through, back))
        made.append((b, a))
    return LoopDraws(np.array([b for b, _ in made]), np.array([a for _, a in made]), sample_time_s)


@dataclass(frozen=True)
class _Equation:
    """One row of a predictor as polynomials in the delay of one sample."""

    own: Array
    other: Array
    summed: Array
    driven: Array

    @classmethod
    def rows(cls, made: LoopPredictor) -> list[_Equation]:
        """Of the estimate, then of each draw."""
        return [
            cls(*row) for row in zip(made.own, made.other, made.summed, made.driven, strict=True)
        ]

    @property
    def past(self) -> Array:
        """One less what its own past makes of it."""
        return _delayed(-self.own, 1.0)

    @property
    def through(self) -> Array:
        """What the other channel makes of it."""
        return _delayed(self.other)

    def differences(self, polynomial: Array, sign: float = 1.0) -> Array:
        """A polynomial with the sum beside it, both times what makes differences of sums."""
        return _sum(np.convolve(polynomial, [1.0, -1.0]), sign * _delayed(self.summed))


def _delayed(coefficients: Array, first: float = 0.0) -> Array:
    return np.concatenate([[first], coefficients])


def _sum(one: Array, two: Array) -> Array:
    longer = np.zeros(max(one.size, two.size))
    longer[: one.size] += one
    longer[: two.size] += two
    return longer
