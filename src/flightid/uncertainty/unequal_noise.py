"""Noise that grows with what a fit looks at: heteroscedastic residuals, coloured or not.

A covariance by the mean power of the noise is too small where noise is large at the samples that
tell the estimates. Residuals go through the whitening filter of their noise model, sensitivities
backwards through its inverse: what is left at each sample is independent of the others, of a power
of its own, and the sum of squares of scores is consistent whatever makes that power.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid._native import rank_bounds, ranks
from flightid.frozen import dataclass
from flightid.recursive_filter import filtered
from flightid.uncertainty.blocks import RecordBlock, halves, levels, of_all_halves
from flightid.uncertainty.quantiles import normal_quantiles
from flightid.uncertainty.residual_noise import Autoregression

Array = NDArray[np.float64]
FALSE_ALARM = 0.01
"""Chance of a fit that noise of one power throughout is said to grow."""
FREE = 0.1
"""Share of a residual's variance below which the fit has taken it: it tells nothing of noise."""
MOST = 20_000
"""Samples of a record that are ranked: more tell no more."""
LEAST = 40
"""Samples of a record from which ranks are compared."""
BESIDE_DRIFT = 40
"""Order of the filter that whitens noise with a drift, which has no finite one."""


@dataclass(frozen=True, eq=False)
class Innovations:
    """One output of one record, whitened.

    Attributes
    ----------
    columns : ndarray, shape (n_samples, k + 2 n)
        What own numbers that reach the output and parameters, by halves, hear of each innovation.
    errors : ndarray, shape (n_samples,)
        Innovations over the root of the share that the fit left of them.
    free : ndarray, shape (n_samples,)
        That share.
    """

    columns: Array
    errors: Array
    free: Array

    @classmethod
    def of(cls, noise: Autoregression, block: RecordBlock, output: int) -> Innovations:
        """Whitened by a model of the noise."""
        free = _free(*block.of_output(output))
        errors = _innovations(noise, block.residual[output]) / np.sqrt(free)
        return cls(_heard(noise, halves(block, output)), errors, free)

    def excess(self, level: float) -> Array:
        """Products of scores beyond those of innovations of one power (HC3)."""
        power = self.errors**2 / self.free - level
        return np.asarray(self.columns.T @ (power[:, None] * self.columns))


@dataclass(frozen=True, eq=False)
class Ranks:
    """One output of one record, whose ranks are of unit variance about zero.

    Attributes
    ----------
    noise : ndarray, shape (n_samples,)
        Ranks of its size.
    signals : ndarray, shape (n_asked + 1, n_samples)
        Square of what each parameter, and all of them together, make of each innovation.
    """

    noise: Array
    signals: Array

    @classmethod
    def of(
        cls, noise: Autoregression, block: RecordBlock, output: int, half: Array
    ) -> Ranks | None:
        """Whitened by a model of the noise; `half` turns scores to changes of some estimates.

        None where samples are few.
        """
        free = _free(*block.of_output(output))
        kept = np.flatnonzero(free > FREE)
        if kept.size > MOST:
            first = (kept.size - MOST) // 2
            kept = kept[first : first + MOST]
        if kept.size < LEAST:
            return None
        heard = _heard(noise, block.of_output(output)[1])
        size = np.einsum("ij,jk,ik->i", half, heard.T @ heard / len(heard), half)
        errors = _innovations(noise, block.residual[output])
        if kept.size < len(errors):
            errors, heard, free = errors[kept], heard[kept], free[kept]
        errors = errors / np.sqrt(free)
        signals = np.empty((len(half) + 1, len(errors)))
        each = signals[:-1]
        np.matmul(half, heard.T, out=each)
        np.square(each, out=each)
        np.matmul(1.0 / np.maximum(size, np.finfo(float).tiny), each, out=signals[-1])
        return cls(ranks(np.abs(errors)), signals)

    @cached_property
    def most(self) -> Array:
        """What rank correlations do not pass, shape (n_asked + 1,): without ranks of signals."""
        return rank_bounds(self.signals, self.noise)

    def together(self, rows: Array) -> Array:
        """Rank correlations of some signals' ranks with those of the noise."""
        return np.asarray(rows @ self.noise / self.noise.size)

    def ranked(self, some: NDArray[np.intp]) -> Array:
        """Ranks of some signals."""
        return np.array([ranks(row) for row in self.signals[some]])

    def counted(self, rows: Array) -> Array:
        """Samples that count of signals of such ranks: of slow ones fewer are independent."""
        slow = _correlations(rows) @ _correlations(self.noise[None])[0]
        return np.asarray(self.noise.size / np.maximum(1.0, 1.0 + 2.0 * slow))


def _score(known: Sequence[Ranks], limit: float) -> float:
    """Largest score of all signals, or what none of them passes where that is below a limit.

    No more samples count than there are: by the inequality of Cauchy and Schwarz this bounds most
    scores of noise of one power, without the correlations of long rows. Counts in buckets bound
    those bounds: of most noise no signal is sorted.
    """
    some, bound = _beyond(known, [each.most for each in known], limit)
    if not some.size:
        return float(np.max(bound))
    rows = [each.ranked(some) for each in known]
    together = [each.together(ranked) for each, ranked in zip(known, rows, strict=True)]
    places, bound = _beyond(known, together, limit)
    if not places.size:
        return float(np.max(bound))
    counted = [each.counted(ranked[places]) for each, ranked in zip(known, rows, strict=True)]
    moved = [each[places] * count for each, count in zip(together, counted, strict=True)]
    return float(np.max(np.sum(moved, axis=0) / np.sqrt(np.sum(counted, axis=0))))


def _beyond(
    known: Sequence[Ranks], together: Sequence[Array], limit: float
) -> tuple[NDArray[np.intp], Array]:
    """Signals whose bound by rank correlations of each record passes a limit, and all bounds."""
    pairs = zip(known, together, strict=True)
    most = [np.maximum(each, 0.0) ** 2 * one.noise.size for one, each in pairs]
    bound = np.sqrt(np.sum(most, axis=0))
    return np.flatnonzero(bound > limit), bound


def _correlations(rows: Array) -> Array:
    """Correlations of rows at lags from one on, up to an eighth of the samples, by a triangle.

    Bartlett (1935): the error of a correlation of two rows that both change slowly.
    """
    n = rows.shape[1]
    power = np.abs(np.fft.rfft(rows, 2 * n)) ** 2
    count = max(n // 8, 2)
    lags = np.arange(1, count)
    return np.asarray(np.fft.irfft(power)[:, 1:count] / n * (1.0 - lags / count))


def _whitener(noise: Autoregression) -> Array:
    """Weights of the past by which noise is foretold."""
    if noise.drift is None:
        return noise.weights
    order = min(BESIDE_DRIFT, noise.n // 20)
    lags = noise.autocovariance(order + 1)
    return np.asarray(scipy.linalg.solve_toeplitz(lags[:-1], lags[1:]))


def _free(own: Array, shared: Array) -> Array:
    """Share of each innovation that the fit left."""
    taken = np.einsum("ij,ij->i", shared, shared)
    if own.shape[1]:
        taken += np.einsum("ij,ij->i", own, own)
    return np.asarray(np.clip(1.0 - taken, FREE, 1.0))


def _innovations(noise: Autoregression, residual: Array) -> Array:
    """What the past does not foretell of a residual."""
    weights = _whitener(noise)
    if not weights.size:
        return residual
    return filtered(np.concatenate(([1.0], -weights)), [1.0], residual)


def _heard(noise: Autoregression, columns: Array) -> Array:
    """What columns of samples hear of each innovation: whitening, backwards in time."""
    weights = _whitener(noise)
    if not weights.size:
        return columns
    return filtered([1.0], np.concatenate(([1.0], -weights)), columns[::-1], axis=0)[::-1]


def unequal_outputs(
    models: Sequence[Autoregression], blocks: Sequence[RecordBlock], half: Array
) -> dict[int, list[Innovations]]:
    """Outputs whose noise grows with what tells the parameters: their innovations by record.

    Parameters
    ----------
    models : sequence of Autoregression
        By output.
    blocks : sequence of RecordBlock
        By record, along directions of unit information.
    half : ndarray, shape (n_asked, n)
        From scores of the blocks to changes of the estimates that are asked.

    Returns
    -------
    dict of int to list of Innovations
        Empty where ranks of the noise's size, and of what each parameter or all of them make of
        the noise, go together no more than chance makes of them: 1 % false alarms of a fit.

    Reference
    ---------
    White (1980), A heteroskedasticity-consistent covariance matrix estimator and a direct test for
    heteroskedasticity, Econometrica 48, 817-838; ranks: Spearman (1904); their error: Bartlett
    (1935), J. Royal Statistical Society 98, 536-543.

    Example
    -------
    >>> r = np.random.default_rng(0)
    >>> signal, noise = np.sin(np.arange(400) / 9.0), r.standard_normal(400)
    >>> rows = (signal / np.linalg.norm(signal))[None, :, None]
    >>> white = [Autoregression(np.ones(1), np.empty(0), 400, 0)]
    >>> def grows(error):
    ...     block = RecordBlock.of(rows, np.zeros((1, 400, 0)), error[None])
    ...     return list(unequal_outputs(white, [block], np.eye(1)))
    >>> grows(noise), grows(noise * signal)
    ([], [0])
    """
    found = {}
    tests = max(len(models) * (len(half) + 1), 1)
    limit = float(normal_quantiles([1.0 - FALSE_ALARM / tests])[0])
    for output, noise in enumerate(models):
        # Most noise is of one power: innovations are made where they are summed, not before.
        asked = (Ranks.of(noise, block, output, half) for block in blocks)
        known = [each for each in asked if each is not None]
        if known and _score(known, limit) > limit:
            found[output] = [Innovations.of(noise, block, output) for block in blocks]
    return found


def with_excess(
    apart: Sequence[Array],
    models: Sequence[Autoregression],
    blocks: Sequence[RecordBlock],
    unequal: dict[int, list[Innovations]],
) -> list[Array]:
    """What `noise_heard` gives, with the power that the noise has where it is heard.

    Parameters
    ----------
    apart : sequence of ndarray, shape (n_outputs, m + 2 n, m + 2 n)
        By record.
    models, blocks : sequence
        As for `unequal_outputs`.
    unequal : dict of int to list of Innovations
        What that gave.

    Reference
    ---------
    MacKinnon & White (1985), J. Econometrics 29, 305-325 (HC3); Andrews & Monahan (1992),
    Econometrica 60, 953-966 (whitening before scores are summed).
    """
    made = [each.copy() for each in apart]
    share = levels(blocks)
    for output, parts in unequal.items():
        for record, part in enumerate(parts):
            level = share[record, output] * models[output].innovation
            made[record][output] += of_all_halves(part.excess(level), blocks[record], output)
    return made


def widened_by(before: Array, after: Array) -> tuple[Array, Array]:
    """The first of two covariances, longer where the second is, never shorter, and by how much.

    Returns
    -------
    ndarray, ndarray
        The covariance, shape (n, n), and ratios of standard errors, shape (n,).

    Example
    -------
    >>> wider, times = widened_by(np.eye(2), np.diag([4.0, 0.25]))
    >>> np.diag(wider).round(6).tolist(), times.round(6).tolist()
    ([4.0, 1.0], [2.0, 1.0])
    """
    size = np.sqrt(np.diag(before))
    if not size.size or not np.all(size > 0.0):
        return before, np.ones(size.size)
    plain, other = before / np.outer(size, size), after / np.outer(size, size)
    own, axes = np.linalg.eigh(plain)
    root = axes * np.sqrt(np.maximum(own, np.finfo(float).eps * own[-1]))
    back = np.linalg.inv(root)
    gains, along = np.linalg.eigh(back @ (other - plain) @ back.T)
    grown = root @ along * np.sqrt(np.maximum(gains, 0.0))
    wider = before + size[:, None] * (grown @ grown.T) * size
    return wider, np.sqrt(np.diag(wider)) / size
