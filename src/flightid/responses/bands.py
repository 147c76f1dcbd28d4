"""Bands of a measured response: where it can be trusted, and which frequencies to take."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError

COHERENT = 0.6
"""Coherence γ² from which a frequency counts."""

FEWEST_WINDOWS = 5.0
"""Independent windows that a coherence is worth at least: 0.6 of so many is an error of 26 %, and
intervals of 95 % reach ±50 % in gain and ±30° in phase."""


def allowed_coherence(random_error: NDArray[np.float64]) -> NDArray[np.float64]:
    """Most coherence γ² that random errors allow: that of five independent windows with them.

    Coherence alone says nothing of how many windows it was averaged over; what is usable by its
    coherence is to be usable by its bar too.

    Parameters
    ----------
    random_error : ndarray
        Standard error of a part over the size of the response.

    Reference
    ---------
    Bendat & Piersol, *Random Data*, 4th ed., section 9.1: ε² = (1 − γ²)/(2 n γ²).

    Example
    -------
    >>> allowed_coherence(np.array([0.0, 0.1, 0.3])).round(2)
    array([1.  , 0.91, 0.53])
    """
    return np.asarray(1.0 / (1.0 + 2.0 * FEWEST_WINDOWS * np.square(random_error)))


def usable_band(
    omega_rad_s: NDArray[np.float64], coherence: NDArray[np.float64], minimum: float = COHERENT
) -> tuple[float, float] | None:
    """Widest unbroken band, in decades, in which coherence stays at or above a minimum.

    Parameters
    ----------
    omega_rad_s, coherence : ndarray, shape (n_f,)
    minimum : float
        Smallest coherence γ².

    Returns
    -------
    tuple of float, or None
        Lowest and highest frequency, rad/s; None where fewer than two neighbours reach it.

    Example
    -------
    >>> usable_band(np.array([1.0, 2.0, 4.0, 8.0]), np.array([0.2, 0.7, 0.9, 0.5]))
    (2.0, 4.0)
    """
    runs = [run for run in coherent_parts(omega_rad_s, coherence, minimum) if run[1] > run[0]]
    return max(runs, key=lambda run: run[1] / run[0]) if runs else None


def coherent_parts(
    omega_rad_s: NDArray[np.float64], coherence: NDArray[np.float64], minimum: float = COHERENT
) -> list[tuple[float, float]]:
    """Lowest and highest frequency, rad/s, of each unbroken run of coherent frequencies.

    Parameters
    ----------
    omega_rad_s, coherence : ndarray, shape (n_f,)
    minimum : float
        Smallest coherence γ².

    Example
    -------
    >>> coherent_parts(np.array([1.0, 2.0, 4.0, 8.0]), np.array([0.7, 0.7, 0.1, 0.9]))
    [(1.0, 2.0), (8.0, 8.0)]
    """
    good = np.concatenate([[False], coherence >= minimum, [False]])
    edges = np.flatnonzero(np.diff(good.astype(np.int8)))
    return [
        (float(omega_rad_s[first]), float(omega_rad_s[end - 1]))
        for first, end in zip(edges[::2], edges[1::2], strict=True)
    ]


def coherent_band(
    omega_rad_s: NDArray[np.float64], coherence: NDArray[np.float64], minimum: float = COHERENT
) -> tuple[tuple[float, float] | None, float]:
    """Lowest and highest coherent frequency, and the width of all coherent ones together.

    Gaps may lie between: near a lightly damped mode a pilot in the loop keeps the input small, and
    coherence dips in the middle of a good response.

    Parameters
    ----------
    omega_rad_s, coherence : ndarray, shape (n_f,)
    minimum : float
        Smallest coherence γ².

    Returns
    -------
    tuple of (tuple of float, or None) and float
        rad/s, and decades; None where nothing is coherent.

    Example
    -------
    >>> coherent_band(np.array([1.0, 10.0, 100.0]), np.array([0.9, 0.1, 0.8]))
    ((1.0, 100.0), 1.0)
    """
    coherent = coherence >= minimum
    if not np.any(coherent):
        return None, 0.0
    # Each frequency stands for half the way to its neighbours.
    middles = np.log10(omega_rad_s)
    edges = np.concatenate([middles[:1], (middles[1:] + middles[:-1]) / 2, middles[-1:]])
    low, high = (float(omega_rad_s[coherent][place]) for place in (0, -1))
    return (low, high), float(np.sum(np.diff(edges)[coherent]))


def nearest(grid: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.intp]:
    """Index of the grid frequency nearest to each wanted one, on a log scale."""
    distance = np.abs(np.log(wanted)[:, None] - np.log(grid)[None, :])
    return np.asarray(np.argmin(distance, axis=1))


def choose_frequencies(
    grid: NDArray[np.float64],
    omega_rad_s: ArrayLike | None,
    band_rad_s: tuple[float, float] | None,
    n_omega: int | None,
) -> NDArray[np.intp]:
    """Indices of the grid frequencies that a band, a log spacing in it or a list means.

    Raises
    ------
    DataError
        No frequency lies in the band, or one is not positive.
    """
    if omega_rad_s is None and band_rad_s is None:
        return np.arange(len(grid))
    given = band_rad_s if omega_rad_s is None else omega_rad_s
    values = np.atleast_1d(np.asarray(given, dtype=np.float64))
    if np.any(values <= 0.0) or not np.all(np.isfinite(values)):
        raise DataError("frequencies must be positive", found=given, needed="rad/s above zero")
    if omega_rad_s is not None:
        return np.unique(nearest(grid, values))
    inside = np.flatnonzero((grid >= values[0] * (1 - 1e-9)) & (grid <= values[1] * (1 + 1e-9)))
    if not inside.size:
        raise DataError(
            "no frequency of the response lies in the band",
            found=f"{values[0]:.4g} to {values[1]:.4g} rad/s",
            needed=f"a part of {grid[0]:.4g} to {grid[-1]:.4g} rad/s",
        )
    if n_omega is None:
        return inside
    return np.unique(inside[nearest(grid[inside], np.geomspace(values[0], values[1], n_omega))])
