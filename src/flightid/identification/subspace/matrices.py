"""Gain of the predictor, and input matrices once A and C are known."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.identification.subspace.data import SubspaceData
from flightid.models.innovations.prediction import free_motion
from flightid.models.sampled.recursion import run_recursion, spectral_radius

Array = NDArray[np.float64]
STABLE = 1.0 - 1e-6
INSIDE = 1.0 - 1e-3
"""Size of a pole that was at the circle."""
NOISELESS = 1e-16
"""Innovations with less than this share of the outputs' power are rounding."""


def kalman_gain(a: Array, c: Array, q: Array, s: Array, r: Array) -> Array:
    """Steady Kalman gain of noises with covariances Q, S, R, outputs of unit power.

    Without noise there is no gain to find: zero, or for an unstable model one that stabilises it.
    """
    n = a.shape[0]
    if np.trace(r) > NOISELESS * r.shape[0]:
        gain = _riccati(a, c, q, s, r)
        if gain is not None:
            return gain
    if spectral_radius(a) < STABLE:
        return np.zeros((n, c.shape[0]))
    gain = _riccati(a, c, np.eye(n), np.zeros((n, c.shape[0])), np.eye(c.shape[0]))
    return np.zeros((n, c.shape[0])) if gain is None else gain


def steady_gain(a: Array, c: Array, k: Array, r: Array) -> Array:
    """The gain itself where its predictor is stable, else that of the same noise spectrum."""
    if spectral_radius(a - k @ c) < STABLE:
        return k
    return kalman_gain(a, c, k @ r @ k.T, k @ r, r)


def _riccati(a: Array, c: Array, q: Array, s: Array, r: Array) -> Array | None:
    try:
        p = np.asarray(scipy.linalg.solve_discrete_are(a.T, c.T, q, r, s=s))
        gain = np.asarray(np.linalg.solve((c @ p @ c.T + r).T, (a @ p @ c.T + s).T).T)
    except (np.linalg.LinAlgError, ValueError):
        return None
    if not np.all(np.isfinite(gain)) or spectral_radius(a - gain @ c) >= STABLE:
        return None
    return gain


def stabilised(a: Array) -> Array:
    """A with its eigenvalues outside the unit circle mirrored to the inside.

    Example
    -------
    >>> stabilised(np.diag([2.0, 0.5])).round(3).tolist()
    [[0.5, 0.0], [0.0, 0.5]]
    """
    values, vectors = np.linalg.eig(a)
    size = np.abs(values)
    if not np.any(size >= STABLE):
        return a
    inside = np.where(size >= STABLE, np.minimum(1.0 / size, INSIDE) / size * values, values)
    return np.asarray((vectors * inside @ np.linalg.inv(vectors)).real)


def feedthrough(
    data: SubspaceData, a: Array, c: Array, k: Array, *, direct: bool
) -> tuple[Array, Array]:
    """B and D by least squares on the errors of the predictor, which are linear in them.

    The predictor is stable where the model is not, so records may be long. Initial states of the
    records are fitted beside.
    """
    n, p, m = a.shape[0], data.n_outputs, data.n_inputs
    closed = a - k @ c
    n_free = n * m + (p * m if direct else 0)
    records, own = len(data.outputs), n + (p if data.channels.levels else 0)
    rows, targets = [], []
    for place, (y, u) in enumerate(zip(data.outputs, data.inputs, strict=True)):
        count = y.shape[1]
        columns = np.zeros((n_free + own * records, p, count))
        for j in range(m):
            passed = adjoint_run(closed, c, u[j : j + 1])[0]
            columns[j : n * m : m] = passed
            if direct:
                for o in range(p):
                    column = columns[n * m + o * m + j]
                    column -= np.tensordot(k[:, o], passed, axes=1)
                    column[o] += u[j]
        first = n_free + own * place
        columns[first : first + n] = free_motion(closed, c, count)
        if own > n:
            columns[first + n : first + own] = level_motion(closed, c, k, count)[1]
        rows.append(columns.reshape(columns.shape[0], -1))
        targets.append((y - c @ run_recursion(closed, k @ y)).ravel())
    if not all(np.all(np.isfinite(each)) for each in (*rows, *targets)):
        raise FitError(
            "a subspace model's predictions run away over the records",
            found=f"order {n}, predictor poles up to {np.abs(np.linalg.eigvals(closed)).max():.3g}",
            action="choose another order, or look for outliers and unlike scales in the records",
        )
    found = np.linalg.lstsq(np.hstack(rows).T, np.concatenate(targets), rcond=None)[0]
    d = found[n * m : n_free].reshape(p, m) if direct else np.zeros((p, m))
    return found[: n * m].reshape(n, m), d


def level_motion(closed: Array, c: Array, k: Array, count: int) -> tuple[Array, Array]:
    """What a level of each output makes of a predictor's states and of its outputs.

    Returns
    -------
    tuple of ndarray, shapes (p, n, n_samples) and (p, p, n_samples)
    """
    p = len(c)
    forcing = np.repeat(-k.T[:, :, None], count, axis=2)
    moved = run_recursion(closed, forcing)
    return moved, np.asarray(c @ moved + np.eye(p)[:, :, None])


def adjoint_run(a: Array, c: Array, signals: Array) -> Array:
    """C (q - A)⁻¹ applied to each signal entering each state, (n_signals, n, p, n_samples)."""
    forcing = signals[:, None, None] * c[:, :, None]
    return run_recursion(a.T, forcing).swapaxes(1, 2)
