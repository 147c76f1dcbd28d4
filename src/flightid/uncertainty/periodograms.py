"""Periodograms of records, padded with zeros so that all their lags have room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
