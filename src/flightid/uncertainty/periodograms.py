"""Periodograms of records, padded with zeros so that all their lags have room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
LONGEST_TABLE = 1 << 15
"""Length of a transform up to which a table of its first rows stays in the cache."""
SPANS, TERMS, MOST_LAGS = 8192, 6, 20
"""Spans of the bins of a whole transform, in each of which the cosines of so many lags turn by
7.7e-3 rad from its middle: so many terms of a series leave 3e-16 of them."""


def periodogram(columns: Array, length: int | None = None) -> Array:
    """Mean periodogram of columns (n, k), zero-padded to the next fast length from 2 n."""
    n = columns.shape[0]
    transform = scipy.fft.rfft(columns, transform_length(n) if length is None else length, axis=0)
    return np.asarray(np.mean(np.abs(transform) ** 2, axis=1) / n)


def pooled(records: Sequence[Array], length: int) -> Array:
    """Mean periodogram of records (n, k) of several lengths, by their samples."""
    total = sum(len(each) for each in records)
    return np.asarray(sum(len(each) * periodogram(each, length) for each in records) / total)


def transform_length(n: int) -> int:
    """Fast transform length with room for all lags of n samples."""
    return int(scipy.fft.next_fast_len(2 * n, real=True))


def leaking(spectrum: Array, lengths: Sequence[int], length: int) -> Array:
    """Mean periodogram of records with this spectrum: lag k is seen n - k times in n."""
    k = np.arange(max(lengths))
    seen = sum(np.maximum(n - k, 0) for n in lengths) / sum(lengths)
    lags = scipy.fft.irfft(spectrum, length)[: k.size] * seen
    return np.asarray(2 * scipy.fft.rfft(lags, length).real - lags[0])


def first_lags(power: Array, length: int, largest: int, *, often: bool = False) -> Array:
    """Autocovariance at lags 0 to `largest` from a zero-padded periodogram.

    Parameters
    ----------
    power : ndarray, shape (n_bins,)
        At the bins of a real transform.
    length : int
        Of the transform.
    largest : int
    often : bool
        Whether it is asked many times of one length: a table serves that.

    Example
    -------
    >>> first_lags(np.ones(5), 8, 2, often=True).round(12) + 0.0
    array([1., 0., 0.])
    """
    # A whole transform costs four times the few numbers of it that are asked for, and more.
    if length > LONGEST_TABLE and largest <= MOST_LAGS:
        return _by_spans(power, length, largest)
    if not often or length > LONGEST_TABLE:
        return np.asarray(scipy.fft.irfft(power, length)[: largest + 1])
    return np.asarray(cosines(length, largest) @ power)


def _by_spans(power: Array, length: int, largest: int) -> Array:
    """The same by moments of spans of bins, over each of which no cosine turns far."""
    width = -(-length // SPANS)
    whole = power.size // width * width
    rest = np.pad(power[whole:], (0, width - (power.size - whole)))
    offsets, even, odd = _span_tables(length, largest)
    moments = np.concatenate([power[:whole].reshape(-1, width) @ offsets, rest[None] @ offsets])
    # cos k(c + d) = cos kc cos kd - sin kc sin kd, the latter of each as a series in d.
    turns = np.arange(largest + 1)[:, None] * (np.pi * width / length)
    series = turns ** np.arange(TERMS) / np.array([math.factorial(r) for r in range(TERMS)])
    signs = np.array([1.0, -1.0, -1.0, 1.0])[np.arange(TERMS) % 4]
    on_even, on_odd = even @ moments[:, ::2], odd @ moments[:, 1::2]
    series *= signs
    sums = np.sum(on_even * series[:, ::2], axis=1) + np.sum(on_odd * series[:, 1::2], axis=1)
    sums = 2.0 * sums - power[0]
    if length % 2 == 0:
        sums -= power[-1] * (-1.0) ** np.arange(largest + 1)
    return np.asarray(sums / length)


@lru_cache(maxsize=2)
def _span_tables(length: int, largest: int) -> tuple[Array, Array, Array]:
    """Powers of places in a span (width, TERMS), cosines and sines of lags at their middles."""
    width, n_bins = -(-length // SPANS), length // 2 + 1
    places = np.arange(width, dtype=np.float64) - 0.5 * (width - 1)
    offsets = np.asarray(np.vander(places / (0.5 * width), TERMS, increasing=True), np.float64)
    middles = np.arange(n_bins // width + 1) * width + 0.5 * (width - 1)
    angles = np.multiply.outer(np.arange(largest + 1), 2.0 * np.pi * middles / length)
    found = offsets, np.cos(angles), np.sin(angles)
    for each in found:
        each.flags.writeable = False
    return found


@lru_cache(maxsize=2)
def cosines(length: int, largest: int) -> Array:
    """First rows of the inverse of a real transform, (largest + 1, n_bins)."""
    turn = np.cos(2.0 * np.pi * np.arange(length) / length)
    places = np.multiply.outer(np.arange(largest + 1), np.arange(length // 2 + 1)) % length
    found = turn[places] * (twice(length) / length)
    found.flags.writeable = False
    return np.asarray(found)


def twice(length: int) -> Array:
    """How often each bin of a real transform stands in the whole one, (n_bins,)."""
    found = np.full(length // 2 + 1, 2.0)
    found[0] = 1.0
    if length % 2 == 0:
        found[-1] = 1.0
    return found
