"""Unstable poles of many sampled loops at once, counted from their frequency responses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

COARSE_STEP_RAD = 2.0
"""A larger change of phase from one frequency to the next could hide a turn."""


def phase_change(
    return_difference: NDArray[np.complex128],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Total change of phase along the last axis, and the largest single step, rad.

    Parameters
    ----------
    return_difference : ndarray of complex, shape (…, n_f)
        D = 1 + L, or det(I + L), from a very low frequency to half the sample rate.

    Returns
    -------
    tuple of ndarray, shape (…)
    """
    steps = np.angle(return_difference[..., 1:] * np.conj(return_difference[..., :-1]))
    return steps.sum(axis=-1), np.abs(steps).max(axis=-1)


def integrators(
    omega_rad_s: NDArray[np.float64], return_difference: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """Order of the pole at z = 1 of each loop, from the slope at the lowest two frequencies.

    Parameters
    ----------
    omega_rad_s : ndarray, shape (n_f,)
        Frequencies; the lowest two far below every pole and zero but those at z = 1.
    return_difference : ndarray of complex, shape (…, n_f)

    Returns
    -------
    ndarray of float, shape (…)
        Whole numbers.
    """
    fall = np.log(np.abs(return_difference[..., 0]) / np.abs(return_difference[..., 1]))
    return np.asarray(np.round(fall / np.log(omega_rad_s[1] / omega_rad_s[0])))


def unstable_poles(
    omega_rad_s: NDArray[np.float64],
    return_difference: NDArray[np.complex128],
    open_loop_unstable: NDArray[np.int64] | int,
) -> NDArray[np.int64]:
    """Count closed-loop poles outside the unit circle of sampled loops.

    With z = 1 passed on the outside, D = 1 + L of a loop with P open-loop poles outside the unit
    circle and an integrator of order m turns by Δ from ω = 0⁺ to half the sample rate, and
    Z = P + m/2 − Δ/π closed-loop poles lie outside.

    Parameters
    ----------
    omega_rad_s : ndarray, shape (n_f,)
        Frequencies from far below all dynamics to half the sample rate, rad/s.
    return_difference : ndarray of complex, shape (…, n_f)
        1 + L, for several loops together det(I + L).
    open_loop_unstable : ndarray of int, shape (…), or int
        P.

    Returns
    -------
    ndarray of int, shape (…)
        −1 where the frequencies are too coarse to tell.

    Reference
    ---------
    Franklin, Powell & Workman, *Digital Control of Dynamic Systems*, 3rd ed., section 7.5.1; for
    several loops MacFarlane & Postlethwaite, *Int. J. Control* 25 (1977), 81–127.

    Example
    -------
    >>> omega = np.geomspace(1e-5, np.pi, 400)
    >>> z = np.exp(1j * omega)
    >>> unstable_poles(omega, 1 + np.array([[1.9], [2.1]]) / (z - 1), 0).tolist()
    [0, 1]
    """
    turned, largest = phase_change(return_difference)
    order = integrators(omega_rad_s, return_difference)
    counted = np.round(open_loop_unstable + order / 2.0 - turned / np.pi).astype(np.int64)
    return np.asarray(np.where(largest > COARSE_STEP_RAD, -1, counted))
