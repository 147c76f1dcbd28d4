"""Predictors of what a set-point moves: long regressions, with joint draws of all of them."""

from __future__ import annotations

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.prediction_error.linear_regression import regress
from flightid.review.kernel_posterior import kernel_draws
from flightid.review.loop_samples import LoopSamples

Array = NDArray[np.float64]
WIDENING = 1.1
"""Scatter of draws over that of the regression. A flight of a minute holds slow gusts some fifteen
times, which makes coefficients of the past scatter by more than their covariance says (White 1961,
Biometrika 48), and no prior is centred on the response: counted by
`tests/strangers/ordinary_steps.py`; flights of four minutes need none."""


@dataclass(frozen=True, eq=False)
class LoopPredictor:
    """One predicted channel: coefficients of its own past, of the other's, of the set-point.

    Row 0 of each is the estimate, the others are draws; signs are those of inputs.

    Attributes
    ----------
    own, other, driven : ndarray, shape (1 + draws, lags)
        `other` has no columns where there is no other channel.
    summed : ndarray, shape (1 + draws, 1)
        Of the sum of errors, set-point less measured, up to the sample before.
    """

    own: Array
    other: Array
    summed: Array
    driven: Array


@dataclass(frozen=True, eq=False)
class _Regression:
    """A channel on the past of all: its triangle, what it should give, and where columns stand."""

    channel: Array
    regressors: tuple[Array, ...]
    lags: tuple[int, ...]
    theta: Array
    factor: Array
    wanted: Array
    variance: float

    @classmethod
    def of(
        cls,
        channel: Array,
        other: Array | None,
        sums: Array,
        samples: LoopSamples,
        lags: tuple[int, int, int],
    ) -> _Regression:
        """Of lags of its own, of the other channel and of the set-point, which comes last."""
        # The integrator of a controller sums what it measures, and that may be off by a constant.
        longest = max(samples.lengths)
        ramp = np.concatenate([np.arange(length) / longest for length in samples.lengths])
        beside = () if other is None else (other,)
        regressors = (*beside, sums, ramp, samples.set_point)
        counts = [lags[1]] * len(beside) + [1, 1, lags[2]]
        found = regress(
            channel,
            np.vstack(regressors),
            samples.lengths,
            lags[0],
            counts,
            [1] * len(counts),
            levels=True,
        )
        if found.dependent is not None or not np.isfinite(found.triangle).all():
            raise DataError("not enough motion: the set-point holds too few frequencies")
        variance = found.sum_of_squares / (found.n_rows - found.theta.size)
        wanted = -found.triangle[:-1, -1]
        at = (lags[0], *counts)
        return cls(channel, regressors, at, found.theta, found.factor, wanted, variance)

    def drawn(self, noise: Array, random: np.random.Generator) -> Array:
        """The estimate, then one row for each row of noise, in the coordinates of the triangle.

        The past of the channels is fitted freely: what a prior would take from it, the set-point
        would get. The triangle has it first: its last block is what is left for the set-point.
        """
        past, scaled = self.wanted.size - self.lags[-1], math.sqrt(self.variance) * noise
        factor = self.factor
        mean, drawn = kernel_draws(
            factor[past:, past:],
            self.wanted[past:],
            self.variance,
            scaled[:, past:],
            WIDENING,
            random,
        )
        driven = np.vstack([mean, drawn])
        left = self.wanted[:past] - driven @ factor[:past, past:].T
        left[1:] += WIDENING * scaled[:, :past]
        freely = scipy.linalg.solve_triangular(factor[:past, :past], left.T).T
        return np.hstack([freely, driven])

    def errors(self, lengths: tuple[int, ...]) -> Array:
        """One-step errors, from the first row that has all lags of each piece."""
        skip, ends = max(self.lags), np.cumsum(lengths)
        parts = np.split(self.theta, np.cumsum(self.lags)[:-1])
        made = []
        for begin, end in zip(ends - np.asarray(lengths), ends, strict=True):
            left = self.channel[begin + skip : end].copy()
            for place, part in enumerate(parts):
                signal = self.channel if place == 0 else -self.regressors[place - 1]
                rows = signal[begin + skip - part.size : end - 1]
                left += np.convolve(rows, part, "valid")
            made.append(left - left.mean())
        return np.concatenate(made)

    def predictor(self, found: Array) -> LoopPredictor:
        """Its coefficients by what they stand for."""
        own, *others, summed, _, driven = np.split(found, np.cumsum(self.lags)[:-1], axis=1)
        return LoopPredictor(-own, others[0] if others else found[:, :0], summed, driven)


def predictors(
    samples: LoopSamples, lags: tuple[int, int, int], draws: int, random: np.random.Generator
) -> tuple[LoopPredictor, ...]:
    """Of the measured channel, and of its forerunner where there is one, with joint draws.

    Both have the same regressors, so that what chance does to one it does to the other by as much
    as their one-step errors go together: a gust moves both.

    Parameters
    ----------
    samples : LoopSamples
    lags : tuple of int
        Of the measured channel, of its forerunner, of the set-point.
    draws : int
    random : Generator

    Raises
    ------
    DataError
        The set-point holds too few frequencies.

    Reference
    ---------
    Zellner (1962), J. American Statistical Association 57 (equations of the same regressors).
    """
    own, other, driven = lags
    w, y, sums = samples.forerunner, samples.measured, samples.sums_of_errors()
    first = _Regression.of(y, w, sums, samples, (own, other, driven))
    noise = random.standard_normal((draws, first.wanted.size))
    ahead = first.drawn(noise, random)
    if w is None:
        return (first.predictor(ahead),)
    second = _Regression.of(w, y, sums, samples, (other, own, driven))
    shared = _seen_from(first, second, noise)
    together = float(
        np.corrcoef(first.errors(samples.lengths), second.errors(samples.lengths))[0, 1]
    )
    alone = random.standard_normal(noise.shape)
    beside = second.drawn(together * shared + math.sqrt(1.0 - together**2) * alone, random)
    return first.predictor(ahead), second.predictor(beside)


def _seen_from(first: _Regression, second: _Regression, noise: Array) -> Array:
    """Noise in the coordinates of one triangle, in those of another of the same regressors.

    Columns of the second stand in another order: its own past, which counts as what it is and not
    as an input, was the other's.
    """
    own, other = first.lags[:2]
    by_column = noise @ first.factor
    moved = np.hstack(
        [-by_column[:, own : own + other], -by_column[:, :own], by_column[:, own + other :]]
    )
    return np.asarray(scipy.linalg.solve_triangular(second.factor, moved.T, trans="T").T)
