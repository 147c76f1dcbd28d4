"""Pilots in a loop: by what excitations make of the inputs, which knows nothing of the noise.

Where a stretch was not excited, inputs follow the outputs' noise alone, and a pilot fitted to them
directly leans to minus the inverse of the controller; windows carry that into the excited band.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.responses.errors.pilot_errors import (
    acting_in,
    noise_weights,
    slopes_of,
    taken_by,
)
from flightid.responses.errors.pilot_search import SPARE, PilotBins, PilotState, turns
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
    places = [acting_in(measured, state, place) for place in range(len(measured.output))]
    found, slopes = _made(measured, state, scale, weights), slopes_of(excited, state, scale)
    taken = taken_by(slopes, places, weights)
    for _ in range(PASSES):
        weights = noise_weights(omega, target - found.modelled, target, taken[0])
        found = _made(measured, found, scale, weights)
        found = _settled(measured, excited, found, scale, weights)
        slopes = slopes_of(excited, _made(excited, found, scale, weights), scale)
        taken = taken_by(slopes, places, weights)
    return found, slopes, taken


def _settled(
    measured: PilotBins, excited: PilotBins, state: PilotState, scale: float, weights: Real
) -> PilotState:
    """Steps by instruments from a state, each of which foretells less of the residuals."""
    found = state
    instruments = _weighed(excited, _made(excited, state, scale, weights), scale, weights)
    basis = np.linalg.qr(instruments.T)[0]
    foretold = _foretold(basis, found)
    for _ in range(STEPS):
        if foretold < SETTLED * found.cost * measured.size:
            break
        sensitivities = _weighed(measured, found, scale, weights)
        right = basis.T @ _parts(found.residual)
        step = np.linalg.lstsq(basis.T @ sensitivities.T, right, rcond=1e-10)[0]
        length = 1.0
        for _ in range(HALVINGS):
            moved = _made(measured, _moved(found, np.asarray(length * step)), scale, weights)
            peaked = has_unseen_peak(measured.omega, moved.numerators, moved.denominator, scale)
            left = _foretold(basis, moved)
            if left < foretold and not peaked:
                break
            length *= 0.5
        else:
            break
        found, foretold = moved, left
    return found


def _foretold(basis: Real, state: PilotState) -> float:
    """Power of the weighed residuals that instruments foretell."""
    return float(np.sum((basis.T @ _parts(state.residual)) ** 2))


def _parts(values: Complex) -> Real:
    return np.concatenate([values.real, values.imag], axis=-1)


def _weighed(data: PilotBins, state: PilotState, scale: float, weights: Real) -> Real:
    """Slopes by all coefficients as real rows, shape (n_coefficients, 2 n_bins)."""
    slopes = slopes_of(data, state, scale)
    places = [acting_in(data, state, place) for place in range(len(slopes))]
    rows = np.zeros((1 + max(int(at[-1]) for at in places), data.size), dtype=np.complex128)
    ends = np.cumsum([0, *(each.shape[1] for each in slopes)])
    for part, at, first, last in zip(slopes, places, ends[:-1], ends[1:], strict=True):
        rows[at, first:last] = part
    return _parts(rows * weights)


def _moved(state: PilotState, step: Real) -> PilotState:
    size = len(state.denominator)
    split, own = state.numerators.size, size + SPARE
    last = split + own * len(state.transients)
    transients = step[split:last].reshape(-1, own)
    return PilotState(
        state.numerators + step[:split].reshape(state.numerators.shape),
        np.concatenate([[1.0], state.denominator[1:] + step[last:]]),
        tuple(a + b for a, b in zip(state.transients, transients, strict=True)),
        state.modelled,
        state.residual,
        state.cost,
    )


def _made(data: PilotBins, state: PilotState, scale: float, weights: Real) -> PilotState:
    """The coefficients of a state with what they make of some inputs."""
    order, parts = len(state.denominator) - 1, []
    for omega, u, transient in zip(data.omega, data.inputs, state.transients, strict=True):
        ends = turns(omega, scale, order + SPARE)
        basis = ends[: order + 1]
        above = np.sum((state.numerators @ basis) * u, axis=0) + transient @ ends
        parts.append(above / (state.denominator @ basis))
    modelled = np.concatenate(parts)
    residual = weights * (np.concatenate(data.output) - modelled)
    cost = float(np.mean(np.abs(residual) ** 2))
    return PilotState(
        state.numerators, state.denominator, state.transients, modelled, residual, cost
    )
