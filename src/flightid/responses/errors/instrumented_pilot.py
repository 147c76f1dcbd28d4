"""Pilots in a loop: by what excitations make of the inputs, which knows nothing of the noise.

Where a stretch was not excited, inputs follow the outputs' noise alone, and a pilot fitted to them
directly leans to minus the inverse of the controller; windows carry that into the excited band.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.responses.errors.pilot_basis import PilotBasis, weighed_parts
from flightid.responses.errors.pilot_errors import (
    ending_of,
    noise_weights,
    slopes_of,
    taken_by,
)
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


def instrumented(
    measured: PilotBins, excited: PilotBins, state: PilotState, scale: float, weights: Real
) -> tuple[PilotState, list[Complex], tuple[Real, Real]]:
    """A pilot of the measured inputs whose residuals no instrument foretells.

    Instruments are the slopes of the response to the excited part of the inputs, weighed by the
    noise (refined instrumental variables): the coefficients are those at which instruments times
    residuals vanish, whatever the inputs' other part has of the noise.

    Parameters
    ----------
    measured, excited : PilotBins
        With the inputs as measured, and as excitations alone would have moved them.
    state : PilotState
        The fit to the excited part.
    scale : float
        See `Pilot.scale_rad_s`.
    weights : ndarray, shape (n_bins,)
        One over the root of the noise's spectrum of that fit.

    Returns
    -------
    PilotState, list of ndarray, (ndarray, ndarray)
        Of the measured inputs; slopes of the excited ones, by which the errors go; `taken_by`.

    Reference
    ---------
    Young, *Recursive Estimation and Time-Series Analysis*, 2nd ed. (2011), chapter 7; in closed
    loop: Gilson & Van den Hof, *Automatica* 41 (2005), 241–249.
    """
    target, omega = np.concatenate(measured.output), np.concatenate(measured.omega)
    order = len(state.denominator) - 1
    ending = ending_of(state)
    own, others = (PilotColumns.of(data, order, scale) for data in (measured, excited))
    found, slopes = _with(measured, own, state, weights), slopes_of(others, state)
    taken = taken_by(slopes, ending, weights)
    for _ in range(PASSES):
        weights = noise_weights(omega, target - found.modelled, target, taken[0])
        instruments = PilotBasis.of(weighed_parts(slopes, weights), ending)
        found = _with(measured, own, found, weights)
        found = _settled(measured, own, instruments, found, scale, weights)
        slopes = slopes_of(others, _with(excited, others, found, weights))
        taken = taken_by(slopes, ending, weights)
    return found, slopes, taken


def _settled(
    measured: PilotBins,
    columns: PilotColumns,
    instruments: PilotBasis,
    state: PilotState,
    scale: float,
    weights: Real,
) -> PilotState:
    """Steps by instruments from a state, each of which foretells less of the residuals."""
    found = state
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
        state.modelled,
        state.residual,
        state.cost,
    )


def _with(data: PilotBins, columns: PilotColumns, state: PilotState, weights: Real) -> PilotState:
    """The coefficients of a state with what they make of some inputs."""
    return made(data, columns, weights, state.numerators, state.denominator, state.transients)
