"""Covariance of least squares on Fourier transforms, from the spectra of the residuals."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import SingularError
from flightid.uncertainty.influence import require_apart, require_influence

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
SHARE = 0.3
"""Share of all frequencies that a spectrum is averaged over, to each side."""
FEWEST = 10
"""Frequencies to each side that are averaged at least."""
MOST_TAKEN = 0.9
"""Share of a residual that a fit takes away: more is given back to none."""


def neighbours(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First place, and place after the last, over which each of `count` spectra is averaged.

    Averages stay symmetrical as they near an end, and are one-sided only where too little is left.

    Example
    -------
    >>> low, high = neighbours(100)
    >>> int(low[50]), int(high[50]), int(low[0]), int(high[0])
    (20, 81, 0, 11)
    """
    reach = max(FEWEST, round(SHARE * count))
    place = np.arange(count)
    side = np.maximum(np.minimum(reach, np.minimum(place, count - 1 - place)), FEWEST)
    return np.maximum(place - side, 0), np.minimum(place + side + 1, count)


def averaged(values: NDArray[Any]) -> NDArray[Any]:
    """Mean over neighbouring frequencies, frequency last; see `neighbours`.

    Example
    -------
    >>> averaged(np.ones(30))[:3]
    array([1., 1., 1.])
    """
    low, high = neighbours(values.shape[-1])
    start = np.zeros((*values.shape[:-1], 1), dtype=values.dtype)
    sums = np.concatenate([start, np.cumsum(values, axis=-1)], axis=-1)
    return np.asarray((sums[..., high] - sums[..., low]) / (high - low))


def spectral_covariance(jacobian: Complex, residuals: Complex) -> tuple[Array, float]:
    """Sandwich covariance with the averaged cross-spectra of the residuals between.

    Parameters
    ----------
    jacobian : ndarray of complex, shape (n_equations, n_frequencies, n_parameters)
        Weighted; frequencies ascending.
    residuals : ndarray of complex, shape (n_equations, n_frequencies)
        Weighted.

    Returns
    -------
    covariance : ndarray, shape (n_parameters, n_parameters)
    freedom : float
        Degrees of freedom of an averaged spectrum, for Student's distribution.

    Raises
    ------
    SingularError
        Some combination of the parameters has no influence on the residuals.

    Assumes
    -------
    Errors whose spectra are smooth over the averages, and independent between frequencies, as
    those of stationary noise over a long record are. Biased when a disturbance has narrow lines.

    Reference
    ---------
    Klein & Morelli, *Aircraft System Identification*, §7.1 (complex least squares); White (1982),
    *Econometrica* 50, eq. 2.2; Brockwell & Davis, *Time Series*, 2nd ed., §11.7 (cross-spectra).

    Example
    -------
    >>> rows = np.ones((1, 50, 1), dtype=complex)
    >>> noise = np.exp(2j * np.arange(50))[None]
    >>> covariance, freedom = spectral_covariance(rows, noise)
    >>> round(float(covariance[0, 0]), 4)
    0.0101
    """
    n_parameters = jacobian.shape[2]
    flat = np.concatenate([jacobian.real, jacobian.imag]).reshape(-1, n_parameters)
    scale = np.linalg.norm(flat, axis=0)
    require_influence(scale)
    if len(flat) <= n_parameters:
        raise SingularError(
            "too few harmonics for the parameters",
            found=f"{len(flat)} numbers",
            needed=f"more than {n_parameters}",
            action="widen the band, take longer records, or fix parameters",
        )
    q, triangle = np.linalg.qr(flat / scale)
    require_apart(np.diag(triangle))
    shape = (2, *jacobian.shape)
    unit = q.reshape(shape)[0] + 1j * q.reshape(shape)[1]
    # The fit bends towards each residual by its leverage: half of a complex row's two numbers.
    taken = np.minimum(0.5 * np.sum(np.abs(unit) ** 2, axis=2), MOST_TAKEN)
    freed = residuals / np.sqrt(1.0 - taken)
    cross = averaged(freed[:, None] * freed[None].conj())
    scores = np.einsum("ifp,ijf,jfq->pq", unit.conj(), cross, unit, optimize=True).real
    root = np.linalg.solve(triangle, np.eye(n_parameters)) / scale[:, None]
    low, high = neighbours(residuals.shape[1])
    share = 1.0 - n_parameters / len(flat)
    covariance = 0.5 * root @ scores @ root.T
    return np.asarray(0.5 * (covariance + covariance.T)), float(2.0 * np.mean(high - low) * share)
