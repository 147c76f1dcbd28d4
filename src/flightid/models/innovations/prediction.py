"""Prediction with an innovations model: one step, k steps, free run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.models.innovations.form import InnovationsForm
from flightid.models.sampled.recursion import run_recursion, spent_after

Array = NDArray[np.float64]
RANK = 1e-10
"""Directions of the initial state weaker than this share of the strongest are left at rest."""


def forced_run(model: InnovationsForm, u: Array) -> Array:
    """Response to the inputs alone, shape (p, n_samples), from rest."""
    a, b, c, d, _ = model.matrices
    made = _native.slope_recursion(a, -c, b[None], d[None], np.asarray(u, float), anyhow=True)
    return np.ascontiguousarray(made[:, :, 0].T)


def free_run(model: InnovationsForm, y: Array, u: Array, *, initial_state: str) -> Array:
    """Response to the inputs, shape (p, n_samples), from rest or from the state that fits best."""
    a, _, c, _, _ = model.matrices
    run = forced_run(model, u)
    if initial_state == "zero" or not np.all(np.isfinite(run)):
        return run
    # Beyond these samples nothing is left of any start.
    count = spent_after(a, y.shape[1])
    motion = free_motion(a, c, count)
    if not np.all(np.isfinite(motion)):
        return run
    run[:, :count] += _best(motion, y[:, :count] - run[:, :count])
    return run


def one_step_errors(model: InnovationsForm, y: Array, u: Array, initial_state: str) -> Array:
    """Prediction errors one step ahead, shape (p, n_samples)."""
    a, b, c, d, k = model.matrices
    forced, direct = np.hstack([b - k @ d, k])[None], np.hstack([-d, np.eye(len(c))])[None]
    signals = np.vstack([u, y])
    made = _native.slope_recursion(a - k @ c, c, forced, direct, signals, anyhow=True)
    errors = np.ascontiguousarray(made[:, :, 0].T)
    if initial_state == "zero":
        return errors
    # The state is as uncertain as the outputs: each counts by its innovations.
    r = model.noise_covariance
    whiten = np.eye(len(y)) if r is None else np.linalg.inv(np.linalg.cholesky(r))
    count = spent_after(a - k @ c, y.shape[1])
    motion = free_motion(a - k @ c, whiten @ c, count)
    errors[:, :count] -= np.linalg.solve(whiten, _best(motion, whiten @ errors[:, :count]))
    return errors


def free_motion(a: Array, c: Array, n_samples: int) -> Array:
    """C Aᵗ for t = 0, 1, …, shape (n, p, n_samples): what each initial state makes."""
    n = a.shape[0]
    return np.asarray(c @ run_recursion(a, np.zeros((n, n, n_samples)), np.eye(n)))


def motion_from(a: Array, c: Array, start: Array, n_samples: int) -> Array:
    """C Aᵗ x(0) for t = 0, 1, …, shape (p, n_samples)."""
    found = np.zeros((len(c), n_samples))
    count = spent_after(a, n_samples)
    found[:, :count] = c @ run_recursion(a, np.zeros((len(a), count)), start)
    return found


def _best(motion: Array, errors: Array) -> Array:
    columns = motion.reshape(motion.shape[0], -1).T
    weights = np.linalg.lstsq(columns, errors.ravel(), rcond=RANK)[0]
    return np.asarray((columns @ weights).reshape(errors.shape))


def ahead(
    model: InnovationsForm, y: Array, u: Array, horizon: int, initial_state: str = "estimate"
) -> Array:
    """y(t) minus the part of the noise that is younger than the horizon."""
    errors = one_step_errors(model, y, u, initial_state)
    a, _, c, _, k = model.matrices
    young, gain = errors.copy(), k
    for lag in range(1, min(horizon, y.shape[1])):
        young[:, lag:] += c @ gain @ errors[:, :-lag]
        gain = a @ gain
    return np.asarray(y - young)
