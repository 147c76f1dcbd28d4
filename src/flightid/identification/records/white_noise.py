"""White noise of measured channels: what no model of them can explain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conditioning.smoothing import white_deviation
from flightid.errors import DataError
from flightid.record import Record

Array = NDArray[np.float64]


def white_levels(rows: Array) -> Array:
    """Standard deviation of the white noise of each channel.

    Biased where a sensor's filter has taken the noise from the upper half of the band: too small.

    Parameters
    ----------
    rows : ndarray, shape (n_channels, n_samples)

    Returns
    -------
    ndarray, shape (n_channels,)

    Raises
    ------
    DataError
        Fewer than 16 samples.

    Example
    -------
    >>> time_s, noise = np.arange(400) / 50, np.random.default_rng(0).standard_normal(400)
    >>> bool(abs(white_levels(np.array([np.sin(time_s) + 0.1 * noise]))[0] - 0.1) < 0.01)
    True
    """
    return np.array([white_deviation(row) for row in rows])


def explained_percent(records: Sequence[Record], outputs: Sequence[str]) -> Mapping[str, float]:
    """Percent of each output's variance that its white noise makes; none of short records."""
    try:
        levels = [white_levels(each.matrix(outputs)) for each in records]
    except DataError:
        return {}
    noise = sum(each.n_samples * level**2 for each, level in zip(records, levels, strict=True))
    spread = sum(each.n_samples * np.var(each.matrix(outputs), axis=1) for each in records)
    shares = 100.0 * np.asarray(noise) / np.maximum(spread, 1e-300)
    return dict(zip(outputs, map(float, np.atleast_1d(shares)), strict=True))
