"""Periodograms of records, padded with zeros so that all their lags have room."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
LONGEST_TABLE = 1 << 15
"""Length of a transform up to which a table of its first rows stays in the cache."""


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
    if not often or length > LONGEST_TABLE:
        return np.asarray(scipy.fft.irfft(power, length)[: largest + 1])
    # A whole transform costs four times the few numbers of it that are asked for.
    return np.asarray(_cosines(length, largest) @ power)


@lru_cache(maxsize=2)
def _cosines(length: int, largest: int) -> Array:
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
