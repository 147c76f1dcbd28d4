"""Whether an output's answer depends on its size: a term that grows as its square, asked for.

Quadratic drag, friction and motors whose thrust is no line of their command make a response that
is linear at one size alone. What such a term adds at the frequency of a sweep no linear model can
tell from damping; it adds harmonics besides, and they are where no linear answer to the excitation
is: a score test of one term, its integral, beside every linear answer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.recursive_filter import filtered
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
MOST_LAGS, AHEAD = 200, 5
"""Of the linear answer, at the samples of the test; some ahead, for filters without phase."""
NOISE_ORDER = 24
"""Of the autoregression that whitens what the model leaves."""
SMALL = 1e-6
"""Share of the largest power of the excitation's lags, each of one, below which one holds none."""
TAILS = 0.5, 1.0, 2.0, 4.0
"""Decays over the memory of what answers longer: a wrong structure leaves slow modes whole."""
MOST_COLUMNS = 2 * (MOST_LAGS + AHEAD + len(TAILS))
HALF_WIDTH = 10
"""Of the low-pass before samples are left out, in samples that stay."""
STANDS_OUT = 3.29
"""Standard errors: 0.1 % false alarms. Freedom is of thousands of samples."""


@dataclass(frozen=True, eq=False)
class SizeTerm:
    """One output's term that grows as the square of its size.

    Attributes
    ----------
    slope : Estimate
        Of the output's rate of change over y|y|, per unit of the output and second.
    answers : tuple of ndarray, each shape (n_samples,)
        What a slope of one adds to the output of each record: the decaying integral of y|y|, y what
        follows the excitation linearly.
    """

    slope: Estimate
    answers: tuple[Array, ...]

    @property
    def ratio(self) -> float:
        """Size of the slope over its standard error."""
        return abs(self.slope.value or 0.0) / (self.slope.stderr or np.inf)

    @property
    def stands_out(self) -> bool:
        """Whether it is more than noise makes of it."""
        return self.ratio > STANDS_OUT

    @property
    def most(self) -> float:
        """Its size with two standard errors."""
        return abs(self.slope.value or 0.0) + 2.0 * (self.slope.stderr or 0.0)


@dataclass(frozen=True, eq=False)
class _LinearAnswers:
    """Linear answers to the excitation behind the whitening of one output's noise."""

    whitening: Array
    delayed: list[Array]
    lags: Array
    inverse: Array

    @classmethod
    def of(
        cls, instruments: Sequence[Array], residuals: Sequence[Array], lags: int
    ) -> _LinearAnswers:
        """By what a model leaves of an output."""
        p = NOISE_ORDER
        past = np.vstack([np.lib.stride_tricks.sliding_window_view(e, p)[:-1] for e in residuals])
        now = np.concatenate([e[p:] for e in residuals])
        filtered = np.append(1.0, -np.linalg.lstsq(past[:, ::-1], now, rcond=None)[0])
        delayed = [np.hstack([_lags(row, lags) for row in each]) for each in instruments]
        matrix = np.vstack([_through(filtered, each)[p:] for each in delayed])
        # Whitened, what is slow is small beside what is fast: of like size, or it would be cut.
        size = np.linalg.norm(matrix, axis=0)
        size[size == 0.0] = 1.0
        matrix, delayed = matrix / size, [each / size for each in delayed]
        power, turn = np.linalg.eigh(matrix.T @ matrix)
        kept = power > SMALL * power[-1]
        inverse = (turn[:, kept] / power[kept]) @ turn[:, kept].T
        return cls(filtered, delayed, matrix, inverse)

    def joined(self, rows: Sequence[Array]) -> Array:
        """Whitened, starts left out, records one after another."""
        return np.concatenate([_through(self.whitening, row)[NOISE_ORDER:] for row in rows])

    def linear(self, values: Array) -> Array:
        """Linear answer to the excitation that lies nearest."""
        return np.asarray(self.lags @ self._weights(values))

    def answers(self, rows: Sequence[Array]) -> list[Array]:
        """The same of rows, as they were before whitening, by record."""
        weights = self._weights(self.joined(rows))
        return [each @ weights for each in self.delayed]

    def _weights(self, values: Array) -> Array:
        return np.asarray(self.inverse @ (self.lags.T @ values))


def size_terms(
    instruments: Sequence[Array],
    outputs: Sequence[Array],
    residuals: Sequence[Array],
    sample_time_s: float,
    memory_s: float,
    decay_rad_s: float,
) -> list[SizeTerm] | None:
    """The term of each output.

    Parameters
    ----------
    instruments : sequence of ndarray, each shape (n_instruments, n_samples)
        What no noise of the outputs reaches: excitations, or inputs of an open loop.
    outputs, residuals : sequence of ndarray, each shape (n_out, n_samples)
        Measured, and less what a model makes of the measured inputs.
    sample_time_s : float
    memory_s : float
        Within which a linear answer may have any shape; beyond it decays as a sum of exponentials.
    decay_rad_s : float
        By which the integral of a term forgets, as the vehicle's own damping makes it.

    Returns
    -------
    list of SizeTerm or None
        None where there are too many instruments, or too few samples beside their answers.

    Assumes
    -------
    Noise that is independent of the instruments, as long as it is stationary.

    Reference
    ---------
    Rao, *Proc. Cambridge Phil. Soc.* 44 (1948), 50–57 (score test); Pintelon & Schoukens, *System
    Identification*, 2nd ed., chapter 4 (best linear approximation of a nonlinear system).
    """
    every = max(1, int(memory_s / MOST_LAGS / sample_time_s))
    step, lags = every * sample_time_s, min(MOST_LAGS, int(memory_s / sample_time_s))
    columns = len(instruments[0]) * (lags + AHEAD + len(TAILS))
    thin = [[_thinned(each, every) for each in part] for part in (instruments, outputs, residuals)]
    free = sum(each.shape[1] - NOISE_ORDER for each in thin[0]) - columns
    if columns > MOST_COLUMNS or free < columns:
        return None
    # The integral by trapezia: a half sample later it would miss its own harmonics.
    half, kept = np.full(2, 0.5 * step), np.array([1.0, -np.exp(-decay_rad_s * step)])
    found = []
    for place in range(len(outputs[0])):
        measured, left = ([each[place] for each in part] for part in thin[1:])
        white = _LinearAnswers.of(thin[0], left, lags)
        moved = white.answers(measured)
        terms = [filtered(half, kept, each * np.abs(each)) for each in moved]
        term, rest = white.joined(terms), white.joined(left)
        term, rest = term - white.linear(term), rest - white.linear(rest)
        power = float(term @ term)
        if power <= 0.0:
            return None
        slope = float(term @ rest) / power
        noise = float(np.sum((rest - slope * term) ** 2)) / free
        whole = tuple(
            np.interp(np.arange(each.shape[1]) / every, np.arange(len(term)), term)
            for each, term in zip(outputs, terms, strict=True)
        )
        told = Estimate("slope over y|y|", slope, "1", float(np.sqrt(noise / power)))
        found.append(SizeTerm(told, whole))
    return found


def _thinned(rows: Array, every: int) -> Array:
    """Every so manieth sample, behind a low-pass without phase: zeros beyond the ends."""
    if every == 1:
        return rows
    reach = HALF_WIDTH * every
    place = np.arange(-reach, reach + 1)
    taps = np.sinc(place / every) * np.hamming(place.size)
    padded = np.pad(rows, [(0, 0)] * (rows.ndim - 1) + [(reach, reach)])
    windows = np.lib.stride_tricks.sliding_window_view(padded, place.size, axis=-1)
    return np.asarray(windows[..., ::every, :] @ (taps / taps.sum()))


def _through(weights: Array, row: Array) -> Array:
    return filtered(weights, np.ones(1), row, axis=0)


def _lags(row: Array, count: int) -> Array:
    """The row ahead and delayed, one column each, and its tails; nothing beyond its ends."""
    padded = np.concatenate([np.zeros(count - 1), row, np.zeros(AHEAD)])
    delayed = np.lib.stride_tricks.sliding_window_view(padded, count + AHEAD)
    kept = np.exp(-np.array(TAILS) / count)
    tails = [filtered(np.array([1.0 - k]), np.array([1.0, -k]), delayed[:, 0]) for k in kept]
    return np.column_stack([delayed, *tails])
