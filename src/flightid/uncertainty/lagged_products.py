"""Products of channels with their own past, and least squares from these products alone.

Columns of past samples repeat each other, one sample on: their products follow from those of the
first lag and the samples at both ends, without the columns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid._native import left_of_neighbours, products_at_lags

Array = NDArray[np.float64]
Places = NDArray[np.intp]
RIDGE = 1e-11
"""Added to columns of unit length: noise 110 dB below each channel."""
AT_ONCE = 1024
"""Samples that all lags meet in one product: their copies at each lag stay in the cache."""
FEW = 6
"""Channels up to which sums of weighted pasts are quicker than products of matrices."""
UNEVEN = 1e-3
"""Share of a channel's largest power at any lag below which one of it is rounding of the others."""


def lagged_products(records: Sequence[Array], first: int, longest: int) -> Array:
    """Products of all lags of all channels, summed over the samples from `first` on.

    Parameters
    ----------
    records : sequence of ndarray, each shape (n_channels, n_samples)
    first : int
        First sample that is summed, `longest` at least.
    longest : int
        Longest lag.

    Returns
    -------
    ndarray, shape (longest + 1, n_channels, longest + 1, n_channels)
        ``[i, a, j, b]``: Σ a(t − i) b(t − j).

    Example
    -------
    >>> lagged_products([np.array([[1.0, 2.0, 3.0]])], 1, 1)[:, 0, :, 0]
    array([[13.,  8.],
           [ 8.,  5.]])
    """
    lags, channels = np.arange(longest + 1), len(records[0])
    found = np.empty((lags.size, channels, lags.size, channels))
    now = sum(products_at_lags(x[:, first:], x[:, first - longest :]) for x in records)
    found[0], found[:, :, 0] = np.transpose(now, (2, 0, 1)), now
    # What comes in at the beginning and drops out at the end where both lags grow by one.
    shape = len(records), channels * longest
    begin = np.reshape([x[:, first - 1 - lags[:-1]].T for x in records], shape)
    end = np.reshape([x[:, x.shape[1] - 1 - lags[:-1]].T for x in records], shape)
    moved = (begin.T @ begin - end.T @ end).reshape(longest, channels, longest, channels)
    for lag in lags[1:]:
        found[lag, :, 1:] = found[lag - 1, :, :-1] + moved[lag - 1]
    power = np.einsum("iaia->ia", found)
    if np.any(power.min(axis=0) < UNEVEN * power.max(axis=0)):
        # Where a channel moves at its ends alone, differences of products lose their digits.
        for i, j in product(lags, lags):
            parts = ([x[:, first - k : x.shape[1] - k] for k in (i, j)] for x in records)
            found[i, :, j] = sum(now @ then.T for now, then in parts)
    return found


def weights_of(products: Array, known: Places, targets: Places) -> Array:
    """Least squares of some columns on others from their products, shape (n_known, n_targets)."""
    return _solved(products[np.ix_(known, known)], products[np.ix_(known, targets)])


def explained(products: Array, aims: Array) -> Array:
    """Squares of each target that columns explain.

    Parameters
    ----------
    products : ndarray, shape (n_known, n_known)
        Of the columns.
    aims : ndarray, shape (n_known, n_targets)
        Of the columns with the targets.

    Example
    -------
    >>> explained(np.array([[4.0, 0.0], [0.0, 0.0]]), np.array([[2.0], [0.0]])).round(9)
    array([1.])
    """
    weights = _solved(products, aims)
    return np.asarray(np.sum(weights * (2.0 * aims - products @ weights), axis=0))


def _solved(products: Array, aims: Array) -> Array:
    size = np.sqrt(np.diagonal(products))
    # A column of zeros has no weight; the square of the smallest number would be zero too.
    size = np.where(size > 0.0, size, 1.0)
    scaled = products / np.outer(size, size)
    scaled.flat[:: size.size + 1] += RIDGE
    aims = aims / size[:, None]
    try:
        found = scipy.linalg.cho_solve(scipy.linalg.cho_factor(scaled), aims)
    except np.linalg.LinAlgError:
        # Differences of products lose what columns that are almost combinations have of their own.
        value, vector = np.linalg.eigh(scaled)
        kept = value > RIDGE
        found = (vector[:, kept] / value[kept]) @ (vector[:, kept].T @ aims)
    return np.asarray(found / size[:, None])


def left_by_past(records: Sequence[Array], weights: Array) -> list[Array]:
    """Channels less their weighted pasts, from the first sample that has all lags.

    Sums of products would lose the little that is left of smooth channels.

    Parameters
    ----------
    records : sequence of ndarray, each shape (n_channels, n_samples)
    weights : ndarray, shape (n_lags, n_channels, n_targets)
        Of lags from one sample on; targets are the first channels.

    Returns
    -------
    list of ndarray, each shape (n_targets, n_samples − n_lags)
    """
    order, channels, targets = weights.shape
    if channels <= FEW:
        turned = np.ascontiguousarray(weights[::-1].transpose(2, 0, 1).reshape(targets, -1))
        return [left_of_neighbours(x[:targets, order:], x[:, :-1], turned) for x in records]
    found = []
    for rows in records:
        left = rows[:targets, order:].copy()
        for lag, weight in enumerate(weights, 1):
            left -= weight.T @ rows[:, order - lag : rows.shape[1] - lag]
        found.append(left)
    return found


def products_with_past(news: Sequence[Array], records: Sequence[Array], longest: int) -> Array:
    """Products of all lags of all channels with series that end where their records do.

    Parameters
    ----------
    news : sequence of ndarray, each shape (n_news, n_summed)
    records : sequence of ndarray, each shape (n_channels, n_samples)
    longest : int
        Longest lag.

    Returns
    -------
    ndarray, shape (longest + 1, n_channels, n_news)
    """
    found = np.zeros((longest + 1, len(records[0]), len(news[0])))
    for new, rows in zip(news, records, strict=True):
        found += products_at_lags(new, rows[:, rows.shape[1] - new.shape[1] - longest :])
    return found


def at_lags(
    rows: Array, count: int, longest: int, beside: float | None = None
) -> Iterator[tuple[slice, Array]]:
    """The last samples of rows at all lags, piece by piece of samples.

    Parameters
    ----------
    rows : ndarray, shape (n_channels, n_samples)
    count : int
        Of the samples.
    longest : int
        Longest lag.
    beside : float, optional
        A constant in one more row, the last.

    Yields
    ------
    tuple of slice and ndarray
        Which of these samples, and all channels there at lag 0, all at lag 1 and so on, shape
        ((longest + 1) n_channels, n_samples of the piece).

    Example
    -------
    >>> [(part, lags)] = at_lags(np.array([[1.0, 2.0, 3.0]]), 2, 1)
    >>> lags
    array([[2., 3.],
           [1., 2.]])
    """
    constant = [] if beside is None else [np.full((1, AT_ONCE), beside)]
    for begin in range(0, count, AT_ONCE):
        part = slice(begin, min(begin + AT_ONCE, count))
        first, last = (rows.shape[1] - count + each for each in (part.start, part.stop))
        lags = [rows[:, first - k : last - k] for k in range(longest + 1)]
        yield part, np.concatenate([*lags, *(each[:, : last - first] for each in constant)])


def past(rows: Array, first: int, lags: range) -> Array:
    """Columns of past samples of each row from sample `first` on, (n − first, rows · lags)."""
    n = rows.shape[1]
    return np.concatenate([rows[:, first - lag : n - lag] for lag in lags]).T
