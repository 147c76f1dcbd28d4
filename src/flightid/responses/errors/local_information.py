"""What the bins beside a frequency tell of a response by themselves, with leakage free.

Where a record ends amid motion, its ends reach frequencies at which nothing was excited: their
power is smooth over neighbouring bins, as the leakage of the outputs is, so that no local fit tells
one from the other. A model of the whole band can, by what it assumes of the vehicle alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.responses.windows.local_fit import ORDER, Bins, around, bins_needed

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
REACH = 0.1
"""Of a frequency, to either side: how far bins count as beside it, where these are enough."""
WEAK = 0.03
"""Of its own size squared, the variance of what excitations move of an input from which on nobody
knows what they move: 17 % of standard error."""
NONE = 1e-200
"""Power that is none: of the smallest channels that a record takes the whole has 1e-150."""
LEAST_PART = 1e-12
"""Of a direction's power, below which it is rounding."""


def local_spread(
    inputs: Sequence[Real],
    instruments: Sequence[Real],
    omega_rad_s: Real,
    sample_time_s: float,
) -> Real:
    """Variance of a local estimate for unit noise: polynomials of response and of leakage free.

    Parameters
    ----------
    inputs : sequence of ndarray, each shape (n_in, n_samples)
        Of each record.
    instruments : sequence of ndarray, each shape (n_instruments, n_samples)
        The inputs themselves, or excitations of a closed loop.
    omega_rad_s : ndarray, shape (n_f,)
    sample_time_s : float

    Returns
    -------
    ndarray, shape (n_in, n_f)
        Complex variance over the one-sided spectrum of the noise; infinite where records hold too
        few bins, and where excitations move too little of the inputs beside what a loop feeds back.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., section
    7.2.

    Example
    -------
    >>> t = np.arange(2000) * 0.01
    >>> cut = np.sin(3.0 * t + 0.05 * t**2)[None]
    >>> near, far = local_spread([cut], [cut], np.array([4.0, 20.0]), 0.01)[0]
    >>> bool(far > 1e4 * near)
    True
    """
    known = [Bins.of(each, sample_time_s) for each in instruments]
    moved = [Bins.of(each, sample_time_s).values for each in inputs]
    n_known, n_in = len(known[0].values), len(moved[0])
    needed = bins_needed(n_known, len(known))
    found = np.full((n_in, len(omega_rad_s)), np.inf)
    if min(len(bins.omega) for bins in known) < needed:
        return found
    for at, omega in enumerate(omega_rad_s):
        places = [around(bins, float(omega), _count(bins, omega, needed)) for bins in known]
        square, crossed, power = _normal(known, moved, places, float(omega))
        if np.all(np.real(np.diag(square)) < NONE):
            continue
        inverse = _inverse(square)
        spread, gains = inverse[:: ORDER + 1, :: ORDER + 1], inverse @ crossed
        # From instruments to inputs: one where the inputs are their own instruments.
        turned = np.linalg.pinv(gains[:: ORDER + 1].T)
        found[:, at] = np.real(np.diag(turned.T @ spread @ turned.conj()))
        left = power - np.real(np.einsum("ai,ai->i", crossed.conj(), gains))
        unknowns = (ORDER + 1) * (n_known + len(known))
        freedom = sum(place.stop - place.start for place in places) - unknowns
        left = np.where(left > LEAST_PART * power, left, 0.0) / max(freedom, 1)
        found[found[:, at] * left > WEAK, at] = np.inf
    return found


def _count(bins: Bins, omega: float, needed: int) -> int:
    return max(needed, int(2.0 * REACH * omega / (bins.omega[1] - bins.omega[0])))


def _normal(
    known: Sequence[Bins], moved: Sequence[Complex], places: Sequence[slice], omega: float
) -> tuple[Complex, Complex, Real]:
    """Normal matrix of the response's polynomials, products with the inputs, and their power."""
    width = max(
        float(np.max(np.abs(bins.omega[place] - omega)))
        for bins, place in zip(known, places, strict=True)
    )
    size = len(known[0].values) * (ORDER + 1)
    square = np.zeros((size, size), dtype=np.complex128)
    crossed = np.zeros((size, len(moved[0])), dtype=np.complex128)
    power = np.zeros(len(moved[0]))
    for bins, inputs, place in zip(known, moved, places, strict=True):
        powers = ((bins.omega[place] - omega) / width)[:, None] ** np.arange(ORDER + 1)
        basis = np.linalg.qr(powers)[0]
        values = bins.values[:, place].T
        rows = (values[:, :, None] * powers[:, None, :]).reshape(len(values), -1)
        rows = rows - basis @ (basis.T @ rows)
        square += rows.conj().T @ rows
        aside = inputs[:, place].T
        aside = aside - basis @ (basis.T @ aside)
        crossed += rows.conj().T @ aside
        power += np.sum(np.abs(aside) ** 2, axis=0)
    return square, crossed, power


def _inverse(square: Complex) -> Complex:
    """Inverse of a normal matrix; a direction without power is known as little as rounding lets."""
    sizes = np.sqrt(np.maximum(np.real(np.diag(square)), np.finfo(float).tiny))
    parts, turned = np.linalg.eigh(square / np.outer(sizes, sizes))
    scaled = (turned / np.maximum(parts, LEAST_PART)) @ turned.conj().T
    return np.asarray(scaled / np.outer(sizes, sizes))
