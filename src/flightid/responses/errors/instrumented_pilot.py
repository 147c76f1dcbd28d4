"""Pilots in a loop: by what excitations make of the inputs, which knows nothing of the noise.

Where a stretch was not excited, inputs follow the outputs' noise alone, and a pilot fitted to them
directly leans to minus the inverse of the controller; windows carry that into the excited band.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.responses.errors.pilot_basis import PilotBasis, weighed_parts
from flightid.responses.errors.pilot_errors import (
    basis_of,
    ending_of,
    noise_weights,
    slopes_of,
    spent_in,
)
from flightid.responses.errors.pilot_orders import PilotFit
from flightid.responses.errors.pilot_search import (
    PilotBins,
    PilotColumns,
    PilotState,
    made,
)
from flightid.responses.errors.unseen_peaks import has_unseen_peak

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

PASSES, STEPS, HALVINGS = 3, 8, 6
SETTLED = 1e-4
"""Share of the noise's power that instruments foretell of residuals, from which steps end."""


def instrumented(measured: PilotBins, fit: PilotFit) -> PilotFit:
    """A pilot of the measured inputs whose residuals no instrument foretells.

    Instruments are the slopes of the response to the excited part of the inputs, weighed by the
    noise (refined instrumental variables): the coefficients are those at which instruments times
    residuals vanish, whatever the inputs' other part has of the noise.

    Parameters
    ----------
    measured : PilotBins
        With the inputs as measured.
    fit : PilotFit
        To the inputs as excitations alone would have moved them.

    Returns
    -------
    PilotFit
        Of the measured inputs; its slopes, by which the errors go, are of the excited ones.

    Reference
    ---------
    Young, *Recursive Estimation and Time-Series Analysis*, 2nd ed. (2011), chapter 7; in closed
    loop: Gilson & Van den Hof, *Automatica* 41 (2005), 241–249.
    """
    excited, ending = fit.data, ending_of(fit.state)
    own, others = (data.given.columns(fit.state.order) for data in (measured, excited))
    found, slopes = _with(measured, own, fit.state, fit.weights), fit.slopes
    basis, weights = basis_of(slopes, ending, fit.weights), fit.weights
    spent, omega = spent_in(basis), np.concatenate(measured.omega)
    for _ in range(PASSES):
        left = measured.target - found.modelled
        weights = noise_weights(omega, left, measured.target, spent)
        instruments = basis_of(slopes, ending, weights)
        found = _settled(measured, own, instruments, _with(measured, own, found, weights), weights)
        slopes = slopes_of(others, _with(excited, others, found, weights))
        basis = basis_of(slopes, ending, weights)
        spent = spent_in(basis)
    return PilotFit(measured, found, slopes, basis, spent, weights)


def _settled(
    measured: PilotBins,
    columns: PilotColumns,
    instruments: PilotBasis,
    state: PilotState,
    weights: Real,
) -> PilotState:
    """Steps by instruments from a state, each of which foretells less of the residuals."""
    found, scale = state, measured.given.scale_rad_s
    foretold = _foretold(measured, instruments, found)
    for _ in range(STEPS):
        if foretold < SETTLED * found.cost * measured.size:
            break
        moved_by = weighed_parts(slopes_of(columns, found), weights)
        step = instruments.step(moved_by, _parts(measured, found))
        length = 1.0
        for _ in range(HALVINGS):
            moved = _with(measured, columns, _moved(found, step, length), weights)
            left = _foretold(measured, instruments, moved)
            if left < foretold and not has_unseen_peak(
                measured.omega, moved.numerators, moved.denominator, scale
            ):
                break
            length *= 0.5
        else:
            break
        found, foretold = moved, left
    return found


def _foretold(data: PilotBins, instruments: PilotBasis, state: PilotState) -> float:
    """Power of the weighed residuals that instruments foretell."""
    own, shared = instruments.components(_parts(data, state))
    return float(sum(each @ each for each in own) + shared @ shared)


def _parts(data: PilotBins, state: PilotState) -> list[Real]:
    return [each.view(np.float64) for each in data.by_record(state.residual)]


def _moved(state: PilotState, step: tuple[list[Real], Real], length: float) -> PilotState:
    own, shared = step
    split = state.numerators.size
    return PilotState(
        state.numerators + length * shared[:split].reshape(state.numerators.shape),
        np.concatenate([[1.0], state.denominator[1:] + length * shared[split:]]),
        tuple(a + length * b for a, b in zip(state.transients, own, strict=True)),
        state.under,
        state.modelled,
        state.residual,
        state.cost,
    )


def _with(data: PilotBins, columns: PilotColumns, state: PilotState, weights: Real) -> PilotState:
    """The coefficients of a state with what they make of some inputs."""
    return made(data, columns, weights, state.numerators, state.denominator, state.transients)
