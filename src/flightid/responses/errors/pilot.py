"""A pilot model of the vehicle, good enough to say what an estimator makes of it.

The bias of an estimate (leakage, resolution, interpolation) follows from the response itself, and
more signal does not shrink it. A rational response with the transients of the records' ends, fitted
to the Fourier bins of whole records, has no such bias; what the estimator's weights make of that
model's outputs, less its own response, is the bias to expect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.frozen import dataclass
from flightid.responses.errors.pilot_search import (
    SPARE,
    PilotBins,
    PilotState,
    search,
    spectra_of,
    turns,
)
from flightid.responses.errors.unseen_peaks import has_unseen_peak

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Places = NDArray[np.intp]

ORDERS = (1, 2, 3, 4, 5, 6, 8, 10)
"""Orders that are tried, each started by itself."""
SMOOTHED = 15
"""Bins over which squared residuals are averaged to a noise spectrum."""
LEAST = 1e-10
"""Share of an output's power below which noise is rounding."""
MOST_SPENT = 0.95  # of a bin's noise, that a fit is held to have taken
SPENT = 3.0
"""Equations for each unknown that a fit needs."""
PASSES = 3
"""Fits by the noise that the one before left: of all orders twice, then of the one found."""
PATIENCE = 2
"""Orders beyond the best that are still tried."""


@dataclass(frozen=True)
class Pilot:
    """A rational response of one output to all inputs.

    Attributes
    ----------
    scale_rad_s : float
        Frequency at which the functions of the basis have turned by 90°.
    numerators : ndarray, shape (n_in, order + 1)
    denominator : ndarray, shape (order + 1,)
        First coefficient one.
    outputs : tuple of ndarray, each shape (n_samples,)
        What it says of the output without noise, of each record, from zero to the band's end.
    slopes : tuple of ndarray, each shape (n_acting, n_samples)
        Their derivatives by the coefficients that act in a record: numerators, the record's own
        transient, denominator but its first.
    covariance : ndarray, shape (n_coefficients, n_coefficients)
        Of the coefficients: numerators, transients of all records, denominator but its first.
    spent : tuple of ndarray, each shape (n_bins of the record,)
        Share of each bin's noise that the coefficients took: slow bins are few, and bend the most.
    """

    scale_rad_s: float
    numerators: Real
    denominator: Real
    outputs: tuple[Real, ...]
    slopes: tuple[Real, ...]
    covariance: Real
    spent: tuple[Real, ...]

    @property
    def order(self) -> int:
        """Number of poles."""
        return len(self.denominator) - 1

    def acting(self, record: int) -> Places:
        """Places of a record's slopes among the coefficients."""
        n_in, size = self.numerators.shape
        return acting(n_in * size, size + SPARE, len(self.outputs), size - 1, record)

    def frequency_response(self, omega_rad_s: ArrayLike) -> Complex:
        """Response at frequencies in rad/s, shape (n_in, n_f)."""
        basis = turns(np.asarray(omega_rad_s, dtype=float), self.scale_rad_s, self.order)
        return np.asarray((self.numerators @ basis) / (self.denominator @ basis))

    def response_slopes(self, omega_rad_s: ArrayLike) -> Complex:
        """Derivatives of the response by the coefficients, shape (n_coefficients, n_in, n_f)."""
        basis = turns(np.asarray(omega_rad_s, dtype=float), self.scale_rad_s, self.order)
        basis_over = basis / (self.denominator @ basis)
        response = self.frequency_response(omega_rad_s)
        n_in, size = self.numerators.shape
        found = np.zeros((len(self.covariance), n_in, basis.shape[1]), dtype=np.complex128)
        for column in range(n_in):
            found[column * size : (column + 1) * size, column] = basis_over
        found[len(found) - self.order :] = -basis_over[1:, None] * response
        return found


@dataclass(frozen=True, eq=False)
class Pilots:
    """Pilot models of some records, fitted when first asked for.

    Attributes
    ----------
    inputs, outputs : tuple of ndarray, shapes (n_in, n) and (n_out, n)
        Samples of each record.
    sample_time_s : float
    highest_rad_s : float
        Highest frequency of the response.
    seen : dict
        The estimate of a pilot's slopes, by output and frequencies: see `LinearEstimate`.
    told : list
        Once it was asked for, what bins tell beside each frequency: `LinearEstimate.local_spread`.
    """

    inputs: tuple[Real, ...]
    outputs: tuple[Real, ...]
    sample_time_s: float
    highest_rad_s: float
    seen: dict[tuple[int, bytes], Complex] = field(default_factory=dict, repr=False)
    told: list[Real | None] = field(default_factory=list, repr=False)

    @cached_property
    def found(self) -> list[Pilot | None]:
        """One for each output."""
        return fit_pilots(self.inputs, self.outputs, self.sample_time_s, self.highest_rad_s)


def fit_pilots(
    inputs: Sequence[Real], outputs: Sequence[Real], sample_time_s: float, highest_rad_s: float
) -> list[Pilot | None]:
    """Pilot models of all outputs, by maximum likelihood over the bins of whole records.

    Parameters
    ----------
    inputs, outputs : sequence of ndarray, shapes (n_in, n) and (n_out, n)
        Samples of each record.
    sample_time_s : float
    highest_rad_s : float
        Highest frequency of the response.

    Returns
    -------
    list of Pilot or None
        None where the records hold too few bins.

    Assumes
    -------
    Noise at the outputs alone. Biased by feedback, as direct estimates are: of second order in a
    bias that is computed from it.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., sections
    6.7.1 (the transient as a polynomial over the same denominator), 9.8 and 9.12; order by
    Akaike's criterion for few data (Hurvich & Tsai, *Biometrika* 76, 1989): an order too low would
    be a bias that no covariance holds.
    """
    return [
        _fit_output(
            spectra_of(inputs, [each[row] for each in outputs], sample_time_s, highest_rad_s)
        )
        for row in range(len(outputs[0]))
    ]


def _fit_output(data: PilotBins) -> Pilot | None:
    n_in, n_records = len(data.inputs[0]), len(data.output)
    target = np.concatenate(data.output)
    if not data.size or not np.any(target):
        return None
    last, first = max(each[-1] for each in data.omega), min(each[0] for each in data.omega)
    scale = float(np.sqrt(last * first))
    best: PilotState | None = None
    slopes: list[Complex] = []
    taken = np.zeros(0), np.zeros(0)
    weights = np.ones(data.size)
    tried: tuple[int, ...] = ORDERS
    for _ in range(PASSES):
        lowest, found, since = np.inf, None, 0
        for order in tried:
            unknowns = (order + 1) * (n_in + n_records) + order + SPARE * n_records
            if 2 * data.size < SPENT * unknowns:
                break
            state = search(data, order, scale, weights)
            if has_unseen_peak(data.omega, state.numerators, state.denominator, scale):
                continue
            # The criterion for an unknown variance of the noise.
            height = 2.0 * data.size * np.log(max(state.cost, LEAST))
            height += 2.0 * unknowns / (1.0 - (unknowns + 1.0) / (2.0 * data.size))
            since += 1
            if height < lowest:
                lowest, found, since = height, state, 0
            if since > PATIENCE:
                break
        if found is None:
            break
        if best is not None:
            tried = (len(found.denominator) - 1,)
        best, slopes = found, _slopes(data, found, scale)
        taken = _taken(slopes, [_acting(data, found, place) for place in range(n_records)], weights)
        omega = np.concatenate(data.omega)
        weights = noise_weights(omega, target - found.modelled, target, taken[0])
    return None if best is None else _pilot(data, best, scale, slopes, taken)


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


def _acting(data: PilotBins, state: PilotState, record: int) -> Places:
    size = len(state.denominator)
    return acting(state.numerators.size, size + SPARE, len(data.output), size - 1, record)


def _slopes(data: PilotBins, state: PilotState, scale: float) -> list[Complex]:
    """Derivatives of each record's modelled bins by what acts in it, shape (n_acting, n_f)."""
    order = len(state.denominator) - 1
    found = []
    for u, y, omega in zip(data.inputs, data.by_record(state.modelled), data.omega, strict=True):
        ends = turns(omega, scale, order + SPARE)
        basis = ends[: order + 1]
        rows = [*(row * basis for row in u), ends, -y * basis[1:]]
        found.append(np.concatenate(rows) / (state.denominator @ basis))
    return found


def _taken(slopes: Sequence[Complex], places: Sequence[Places], weights: Real) -> tuple[Real, Real]:
    """Share of each bin's noise that the coefficients took, and their covariance in unit noise.

    A transient acts in the bins of its own record: records are tens, and products of all with all
    would be zeros for the most part.
    """
    ends = np.cumsum([each.shape[1] for each in slopes])[:-1]
    left = [
        np.concatenate([weighed.real, weighed.imag], axis=1)
        for each, weight in zip(slopes, np.split(weights, ends), strict=True)
        for weighed in [each * weight]
    ]
    squares = np.zeros(1 + max(int(each[-1]) for each in places))
    for rows, at in zip(left, places, strict=True):
        squares[at] += np.einsum("ib,ib->i", rows, rows)
    norms = np.maximum(np.sqrt(squares), np.finfo(float).tiny)
    products = np.zeros((len(norms), len(norms)))
    left = [rows / norms[at, None] for rows, at in zip(left, places, strict=True)]
    for rows, at in zip(left, places, strict=True):
        products[np.ix_(at, at)] += rows @ rows.T
    inverse = np.linalg.pinv(products, hermitian=True)
    spent = []
    for rows, at in zip(left, places, strict=True):
        taken = 0.5 * np.einsum("ib,ib->b", inverse[np.ix_(at, at)] @ rows, rows)
        spent.append(np.minimum(taken.reshape(2, -1).sum(axis=0), MOST_SPENT))
    return np.concatenate(spent), inverse / np.outer(norms, norms)


def _pilot(
    data: PilotBins,
    state: PilotState,
    scale: float,
    slopes: Sequence[Complex],
    taken: tuple[Real, Real],
) -> Pilot:
    spent, covariance = taken
    variance = state.cost * data.size / max(2.0 * data.size - len(covariance), 1.0)
    return Pilot(
        scale,
        state.numerators,
        state.denominator,
        data.samples(data.by_record(state.modelled)),
        data.samples(slopes),
        variance * covariance,
        tuple(data.by_record(spent)),
    )


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
