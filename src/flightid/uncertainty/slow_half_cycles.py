"""Slowest half cycles of residuals and of what a fit follows, for the likelihood of a drift.

A walk's cosine transform is independent from half cycle to half cycle, as that of fast noise nearly
is, so the slowest few hold all that there is to know of it; of the others products are enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.uncertainty.fitted_directions import FittedDirections
from flightid.uncertainty.own_directions import spread
from flightid.uncertainty.residual_noise import Autoregression

Array = NDArray[np.float64]
BLOCKS = 1024
"""Sums over blocks, at least so many, stand for longer records: none turns by 0.1 rad in one."""
LEAST_LEVEL = 1e-6
"""Least level of a record over that of all."""


class HalfCycleSums(NamedTuple):
    """One record: products of [own, shared directions, residual] of each output.

    Attributes
    ----------
    high : ndarray, shape (n_outputs, w, w)
        Over fast half cycles, weighed by the fast noise.
    low : ndarray, shape (n_outputs, n_bins, w)
        At slow ones.
    fast : ndarray, shape (n_outputs, n_bins)
        Variance of the fast noise there.
    n_own, n_high : int
    """

    high: Array
    low: Array
    fast: Array
    n_own: int
    n_high: int


def levels_of(residuals: Sequence[Array]) -> Array:
    """Deviation of each record and output over that of all, (n_records, n_outputs)."""
    squares = np.array([np.mean(each**2, axis=1) for each in residuals])
    counts = np.array([each.shape[1] for each in residuals])
    common = counts @ squares / counts.sum()
    ratio = squares / np.where(common > 0.0, common, 1.0)
    return np.sqrt(np.maximum(ratio, LEAST_LEVEL))


@lru_cache(maxsize=4)
def _cosines(n_bins: int, starts: tuple[int, int, int]) -> Array:
    """Rows of the orthonormal cosine transform of n samples at the middles of blocks."""
    n, span, count = starts
    first = np.arange(count) * span
    middle = 0.5 * (first + np.minimum(first + span, n))
    found = np.sqrt(2.0 / n) * np.cos(np.pi / n * np.outer(np.arange(n_bins), middle))
    found[0] /= np.sqrt(2.0)
    found.flags.writeable = False
    return np.asarray(found)


def slowest(residual: Array, taken: FittedDirections, size: Array, n_bins: int) -> Array:
    """Slow half cycles of [own, shared directions, residual] over the record's own levels.

    Parameters
    ----------
    residual : ndarray, shape (n_outputs, n)
    taken : FittedDirections
    size : ndarray, shape (n_outputs,)
        Level of this record, `levels_of`.
    n_bins : int

    Returns
    -------
    ndarray, shape (n_outputs, n_bins, w)
    """
    n = residual.shape[1]
    span = max(1, n // BLOCKS)
    starts = np.arange(0, n, span)
    turns = _cosines(n_bins, (n, span, len(starts)))
    found = []
    count = taken.own.shape[2] + taken.shared.shape[2] + 1
    parts = zip(taken.reaching.columns, taken.shared, residual, size, strict=True)
    for output, (own, shared, row, level) in enumerate(parts):
        columns = [own, shared, row[:, None]]
        if span > 1:
            columns = [_span_sums(each, span) for each in columns]
        whole = np.zeros((n_bins, count))
        whole[:, taken.reaching.within(output, shared.shape[1], 1)] = (
            turns @ np.hstack(columns) / level
        )
        found.append(whole)
    return np.array(found)


def _span_sums(columns: Array, span: int) -> Array:
    """Sums over so many rows each, and over those that are left: a product, quick in memory."""
    n, k = columns.shape
    whole = n // span * span
    found = np.empty((-(-n // span), k))
    np.matmul(
        np.ones(span), columns[:whole].reshape(whole // span, span, k), out=found[: whole // span]
    )
    if whole < n:
        found[-1] = columns[whole:].sum(axis=0)
    return found


def half_cycles(
    fast: Sequence[Autoregression],
    residual: Array,
    taken: FittedDirections,
    low: Array,
    size: Array,
) -> HalfCycleSums:
    """Products of one record for fast noises of some models; `low` are its `slowest`."""
    n_outputs, n_bins, width = low.shape
    n = residual.shape[1]
    high, levels = np.zeros((n_outputs, width, width)), np.zeros((n_outputs, n_bins))
    for o, model in enumerate(fast):
        places = taken.reaching.within(o, taken.shared.shape[2], 1)
        known = None if taken.products is None else taken.products[o]
        if not model.is_white or known is None:
            parts = taken.reaching.columns[o], taken.shared[o], residual[o][:, None]
            columns = np.hstack(parts)
        if model.is_white:
            levels[o] = model.lags[0]
            products = columns.T @ columns if known is None else known
            whole = spread(products / size[o] ** 2, places, width)
            high[o] = (whole - low[o].T @ low[o]) / model.lags[0]
            continue
        turned = scipy.fft.dct(columns, axis=0, norm="ortho", overwrite_x=True) / size[o]
        spectrum = model.spectrum()
        level = np.interp(np.arange(n), np.linspace(0.0, n, len(spectrum)), spectrum)
        levels[o] = level[:n_bins]
        turned[n_bins:] /= np.sqrt(level[n_bins:, None])
        high[o] = spread(turned[n_bins:].T @ turned[n_bins:], places, width)
    return HalfCycleSums(high, low, levels, taken.own.shape[2], n - n_bins)
