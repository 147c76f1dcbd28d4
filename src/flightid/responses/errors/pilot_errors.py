"""What coefficients of a pilot move, what of the noise they take, and how well they are known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.responses.errors.pilot_basis import PilotBasis, weighed_parts
from flightid.responses.errors.pilot_search import SPARE, PilotColumns, PilotState

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Places = NDArray[np.intp]

SMOOTHED = 15
"""Bins over which squared residuals are averaged to a noise spectrum."""
LEAST = 1e-10
"""Share of an output's power below which noise is rounding."""
MOST_SPENT = 0.95  # of a bin's noise, that a fit is held to have taken


def acting(n_numerators: int, n_own: int, n_records: int, order: int, record: int) -> Places:
    """Places, among all coefficients, of those that act in a record.

    Example
    -------
    >>> acting(2, 3, 2, 1, record=1).tolist()
    [0, 1, 5, 6, 7, 8]
    """
    begun, last = n_numerators + record * n_own, n_numerators + n_records * n_own
    spans = (0, n_numerators), (begun, begun + n_own), (last, last + order)
    return np.concatenate([np.arange(*span) for span in spans])


def slopes_of(columns: PilotColumns, state: PilotState) -> list[Complex]:
    """Derivatives of each record's modelled bins by what acts in it, shape (n_acting, n_f)."""
    outputs = np.split(state.modelled, columns.edges)
    found = []
    for fixed, y, basis in zip(columns.fixed, outputs, columns.basis, strict=True):
        n_own = len(basis) + SPARE
        under = 1.0 / (state.denominator @ basis)
        n_fixed = len(fixed) - n_own
        rows = np.empty((len(fixed) + len(basis) - 1, len(y)), dtype=np.complex128)
        np.multiply(fixed[n_own:], under, out=rows[:n_fixed])
        np.multiply(fixed[:n_own], under, out=rows[n_fixed : n_fixed + n_own])
        np.multiply(basis[1:], -y * under, out=rows[n_fixed + n_own :])
        found.append(rows)
    return found


def ending_of(state: PilotState) -> slice:
    """Place of a record's transient among its slopes."""
    first = state.numerators.size
    return slice(first, first + len(state.denominator) + SPARE)


def basis_of(slopes: Sequence[Complex], ending: slice, weights: Real) -> PilotBasis:
    """What coefficients move of the weighed bins, made orthonormal.

    A transient acts in the bins of its own record: records are tens, and products of all with all
    would be zeros for the most part.
    """
    return PilotBasis.of(weighed_parts(slopes, weights), ending)


def spent_in(basis: PilotBasis) -> Real:
    """Share of each bin's noise that the coefficients took."""
    taken = [0.5 * each.reshape(-1, 2).sum(axis=1) for each in basis.taken()]
    return np.asarray(np.minimum(np.concatenate(taken), MOST_SPENT))


def noise_weights(omega_rad_s: Real, residual: Complex, target: Complex, spent: Real) -> Real:
    """One over the root of the noise's spectrum: that of the residuals with what a fit spent.

    Averaged over neighbours in frequency, of whichever record: gusts that pass a slow mode rise and
    fall within fifteen bins of one record, and noise that is taken to be less than it is there
    gives a pilot errors that are too small.

    Parameters
    ----------
    omega_rad_s : ndarray, shape (n_bins,)
        Bins of all records, one record after the other.
    residual, target : ndarray of complex, shape (n_bins,)
    spent : ndarray, shape (n_bins,)

    Example
    -------
    >>> two = np.tile(np.arange(1.0, 41.0), 2)
    >>> noise = np.where(two < 8.0, 2.0, 1.0) + 0j
    >>> weights = noise_weights(two, noise, noise, np.zeros(80))
    >>> bool(np.all(weights[[0, 40]] == 0.5)), bool(np.all(weights[[20, 79]] == 1.0))
    (True, True)
    """
    order = np.argsort(omega_rad_s, kind="stable")
    window = np.ones(min(SMOOTHED, len(residual)))
    power = np.convolve(np.abs(residual[order]) ** 2, window, "same")
    power /= np.convolve(1.0 - spent[order], window, "same")
    least = LEAST * float(np.mean(np.abs(target) ** 2))
    weights = np.empty(len(residual))
    weights[order] = 1.0 / np.sqrt(np.maximum(power, least))
    return weights
