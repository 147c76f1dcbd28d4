"""Measures of a one-sided spectrum: root mean square over a band, and cut-off frequency."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, ShapeError

HALF = 0.5


def band_rms(
    omega_rad_s: NDArray[np.float64],
    density: NDArray[np.float64],
    band: tuple[float, float] | None = None,
) -> float:
    """Root mean square of a channel from its spectrum, over a band.

    Parameters
    ----------
    omega_rad_s : ndarray, shape (n_f,)
        Frequencies, increasing, rad/s.
    density : ndarray, shape (n_f,)
        One-sided auto-spectrum, unit² per Hz.
    band : tuple of float, optional
        Lowest and highest frequency, rad/s; default: all.

    Returns
    -------
    float
        In the unit of the channel.

    Raises
    ------
    DataError
        Fewer than two frequencies, or a band outside them.
    ShapeError
        Arrays that do not fit.

    Reference
    ---------
    Bendat & Piersol, *Engineering Applications of Correlation and Spectral Analysis*, 2nd ed.,
    equation 3.52.

    Example
    -------
    >>> omega = np.linspace(0.1, 2 * np.pi, 50)
    >>> round(band_rms(omega, np.ones(50)) ** 2, 3)
    0.984
    """
    grid, total = _running_power(omega_rad_s, density)
    low, high = (grid[0], grid[-1]) if band is None else band
    if not grid[0] * (1 - 1e-9) <= low < high <= grid[-1] * (1 + 1e-9):
        raise DataError(
            "the band lies outside the spectrum",
            found=f"{low:.4g} to {high:.4g} rad/s",
            needed=f"a part of {grid[0]:.4g} to {grid[-1]:.4g} rad/s",
        )
    ends = np.interp([low, high], grid, total)
    return math.sqrt(max(0.0, float(ends[1] - ends[0])))


def cutoff_frequency(
    omega_rad_s: NDArray[np.float64], density: NDArray[np.float64], fraction: float = HALF
) -> float:
    """Frequency below which a fraction of the power lies; a half gives the pilot's cut-off.

    Parameters
    ----------
    omega_rad_s, density : ndarray, shape (n_f,)
        As for `band_rms`.
    fraction : float
        Share of the mean square, between 0 and 1.

    Returns
    -------
    float
        rad/s.

    Raises
    ------
    DataError
        A spectrum without power, or a fraction outside 0 to 1.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., section 5.5 (the
    cut-off frequency holds half of the mean square, 0.707 of the root mean square).

    Example
    -------
    >>> omega = np.linspace(1.0, 3.0, 101)
    >>> round(cutoff_frequency(omega, np.ones(101)), 6)
    2.0
    """
    if not 0.0 < fraction < 1.0:
        raise DataError("a share of power lies between 0 and 1", found=fraction)
    grid, total = _running_power(omega_rad_s, density)
    if total[-1] <= 0.0:
        raise DataError("the spectrum holds no power", needed="a channel that moves")
    return float(np.interp(fraction * total[-1], total, grid))


def _running_power(
    omega: NDArray[np.float64], density: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean square from the lowest frequency up, by the trapezoidal rule."""
    grid = np.asarray(omega, dtype=np.float64)
    power = np.real(np.asarray(density)).astype(np.float64)
    if grid.ndim != 1 or grid.shape != power.shape:
        raise ShapeError("a spectrum does not fit", found=power.shape, needed=grid.shape)
    if grid.size < 2 or np.any(np.diff(grid) <= 0):
        raise DataError("a spectrum needs two or more increasing frequencies", found=grid.size)
    steps = np.diff(grid) / (2.0 * np.pi) * 0.5 * (power[1:] + power[:-1])
    return grid, np.concatenate([[0.0], np.cumsum(steps)])
