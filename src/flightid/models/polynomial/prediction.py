"""Prediction with a polynomial model: one step, k steps, free run (`polynomial_predictor.rs`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.models.polynomial.polynomials import Polynomials
from flightid.recursive_filter import filtered

Array = NDArray[np.float64]


def one_step_errors(model: Polynomials, output: Array, inputs: Array, initial_state: str) -> Array:
    """Prediction errors one step ahead, shape (n_samples,), of deviations from trim."""
    errors, _ = _native.polynomial_errors(
        output,
        np.ascontiguousarray(inputs),
        [output.size],
        model.structure.native,
        model.theta,
        "unknown" if initial_state == "estimate" else "rest",
        [],
        False,
    )
    return errors


def ahead(
    model: Polynomials,
    output: Array,
    inputs: Array,
    horizon: int,
    initial_state: str = "estimate",
) -> Array:
    """y(t) minus the part of the noise that is younger than the horizon."""
    errors = one_step_errors(model, output, inputs, initial_state)
    above, below = model.noise_transfer
    impulse = np.zeros(horizon)
    impulse[0] = 1.0
    young = filtered(above, below, impulse)
    return np.asarray(output - filtered(young, [1.0], errors))


def forced_run(model: Polynomials, inputs: Array) -> Array:
    """Response to the inputs alone, shape (n_samples,), from rest."""
    run = np.zeros(inputs.shape[1])
    with np.errstate(over="ignore", invalid="ignore"):
        for name, row in zip(model.inputs, inputs, strict=True):
            run += filtered(*model.transfer(name), row)
    return run


def free_motion(model: Polynomials, n_samples: int) -> Array:
    """What each sample before the record makes of the output, shape (count, n_samples)."""
    below = np.asarray(model.a)
    for row in model.distinct_f:
        below = np.convolve(below, row)
    impulse = np.zeros((below.size - 1, n_samples))
    np.fill_diagonal(impulse, 1.0)
    if below.size == 1:
        return impulse
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(filtered([1.0], below, impulse))


def motion_from(model: Polynomials, past: Array, n_samples: int) -> Array:
    """Free motion of the output, shape (n_samples,), from weights of `free_motion`."""
    below = np.asarray(model.a)
    for row in model.distinct_f:
        below = np.convolve(below, row)
    impulse = np.zeros(n_samples)
    count = min(past.size, n_samples)
    impulse[:count] = past[:count]
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(filtered([1.0], below, impulse))


def free_run(model: Polynomials, output: Array, inputs: Array, *, initial_state: str) -> Array:
    """Response to the inputs alone, and with ``"estimate"`` the free motion that fits best."""
    run = forced_run(model, inputs)
    if initial_state == "zero":
        return run
    motion = free_motion(model, output.size)
    if not len(motion) or not (np.all(np.isfinite(run)) and np.all(np.isfinite(motion))):
        return run
    weights = np.linalg.lstsq(motion.T, output - run, rcond=None)[0]
    return np.asarray(run + weights @ motion)
