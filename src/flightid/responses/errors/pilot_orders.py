"""The order of a pilot, by what is left of the bins, weighed by the noise of a fit before."""

from __future__ import annotations

from bisect import bisect

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.errors.pilot_basis import PilotBasis
from flightid.responses.errors.pilot_errors import (
    LEAST,
    basis_of,
    ending_of,
    noise_weights,
    slopes_of,
    spent_in,
)
from flightid.responses.errors.pilot_search import (
    ORDERS,
    SPARE,
    PilotBins,
    PilotState,
    settled,
    started,
)
from flightid.responses.errors.unseen_peaks import has_unseen_peak

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

SPENT = 3.0
"""Equations for each unknown that a fit needs."""
PATIENCE = 2
"""Orders beyond the best that are still tried."""


@dataclass(frozen=True)
class PilotFit:
    """A fit to one output's bins.

    Attributes
    ----------
    data : PilotBins
    state : PilotState
    slopes : list of ndarray, each shape (n_acting, n_f)
        Derivatives of each record's modelled bins.
    basis : PilotBasis
        Of the slopes, weighed.
    spent : ndarray, shape (n_bins,)
        See `spent_in`.
    weights : ndarray, shape (n_bins,)
        One over the root of the noise's spectrum.
    """

    data: PilotBins
    state: PilotState
    slopes: list[Complex]
    basis: PilotBasis
    spent: Real
    weights: Real

    @classmethod
    def of(cls, data: PilotBins, state: PilotState, weights: Real) -> PilotFit:
        """Of a state that was found with weights."""
        slopes = slopes_of(data.given.columns(state.order), state)
        basis = basis_of(slopes, ending_of(state), weights)
        spent = spent_in(basis)
        left = data.target - state.modelled
        weights = noise_weights(np.concatenate(data.omega), left, data.target, spent)
        return cls(data, state, slopes, basis, spent, weights)


def fitted(data: PilotBins, *, beyond: bool = False) -> PilotFit | None:
    """A fit of the order that Akaike's criterion chooses; None where bins are too few.

    The noise is not known at first: what the best of all orders leaves without weights tells it,
    for which the others need not be settled. By these weights every order goes on from where it
    was, and by the noise that the best of them leaves that one is fitted once more; with `beyond`
    the next one in its place, where bins are enough: an order too low is a bias that no covariance
    holds where a pilot extrapolates, and one too high costs little where windows tell.
    """
    if not data.size or not np.any(data.target):
        return None
    known: dict[int, PilotState] = {}
    weights, fit = np.ones(data.size), None
    for settle, orders in ((False, ORDERS), (True, ORDERS), (True, None)):
        among = orders or ((fit.state.order,) if fit else ())
        further = ORDERS[bisect(ORDERS, among[0]) :][:1] if beyond and not orders and among else ()
        state = _best(data, weights, further, known, settle=settle)
        state = state or _best(data, weights, among, known, settle=settle)
        if state is None:
            break
        if not settle:
            state = known[state.order] = settled(data, weights, state)
        fit = PilotFit.of(data, state, weights)
        weights = fit.weights
    return fit


def _best(
    data: PilotBins,
    weights: Real,
    orders: tuple[int, ...],
    known: dict[int, PilotState],
    *,
    settle: bool,
) -> PilotState | None:
    """The best of some orders, each from the state that is known of it, which is replaced."""
    n_in, n_records = len(data.inputs[0]), len(data.output)
    lowest, found, since = np.inf, None, 0
    for order in orders:
        unknowns = (order + 1) * (n_in + n_records) + order + SPARE * n_records
        if 2 * data.size < SPENT * unknowns:
            break
        state = started(data, order, weights, known.get(order))
        known[order] = state = settled(data, weights, state) if settle else state
        if has_unseen_peak(data.omega, state.numerators, state.denominator, data.given.scale_rad_s):
            continue
        # The criterion for an unknown variance of the noise.
        height = 2.0 * data.size * np.log(max(state.cost, LEAST))
        height += 2.0 * unknowns / (1.0 - (unknowns + 1.0) / (2.0 * data.size))
        since += 1
        if height < lowest:
            lowest, found, since = height, state, 0
        if since > PATIENCE:
            break
    return found
