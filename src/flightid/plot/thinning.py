"""Curves of more samples than a screen has pixels, thinned so that no peak is lost."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def thinned(
    time_s: NDArray[np.float64], samples: NDArray[np.float64], maximum: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Smallest and largest sample of many short stretches, in their order and at their own stamps.

    Parameters
    ----------
    time_s, samples : ndarray, shape (n_samples,)
        Signal.
    maximum : int
        Largest number of points kept; a signal that is not longer is returned as it is.

    Returns
    -------
    tuple of ndarray
        Stamps and samples, at most `maximum` of them, with every peak of the signal among them.

    Example
    -------
    >>> stamps, samples = thinned(np.arange(8.0), np.array([0, 3, 1, 2, 9, 5, 4, 6.0]), 4)
    >>> stamps.tolist(), samples.tolist()
    ([0.0, 1.0, 4.0, 6.0], [0.0, 3.0, 9.0, 4.0])
    """
    if samples.size <= maximum:
        return time_s, samples
    _, places = _extremes(samples, maximum)
    kept = np.unique(places)
    return time_s[kept], samples[kept]


def thinned_on_shared_stamps(
    time_s: NDArray[np.float64], samples: NDArray[np.float64], maximum: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Smallest and largest sample of many short stretches, on stamps that every channel shares.

    Parameters
    ----------
    time_s, samples : ndarray, shape (n_samples,)
        Signal.
    maximum : int
        Largest number of points kept; a signal that is not longer is returned as it is.

    Returns
    -------
    tuple of ndarray
        Stamps, beginning and middle of each stretch, and its extremes in their order: equal stamps
        of many channels are stored once in a page.

    Example
    -------
    >>> made = thinned_on_shared_stamps(np.arange(8.0), np.array([0, 3, 1, 2, 9, 5, 4, 6.0]), 4)
    >>> [each.tolist() for each in made]
    [[0.0, 2.0, 4.0, 6.0], [0.0, 3.0, 9.0, 4.0]]
    """
    if samples.size <= maximum:
        return time_s, samples
    edges, places = _extremes(samples, maximum)
    stamps = np.stack([time_s[edges[:-1]], time_s[(edges[:-1] + edges[1:]) // 2]])
    return stamps.T.reshape(-1), samples[places]


def _extremes(
    samples: NDArray[np.float64], maximum: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Edges of the stretches, and where the two extremes of each lie, in their order."""
    edges = np.linspace(0, samples.size, maximum // 2 + 1).astype(np.intp)
    stretches = [*pairwise(edges)]
    low = np.array([a + np.argmin(samples[a:b]) for a, b in stretches])
    high = np.array([a + np.argmax(samples[a:b]) for a, b in stretches])
    return edges, np.sort(np.stack([low, high]), axis=0).T.reshape(-1)
