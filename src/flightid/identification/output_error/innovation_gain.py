"""Innovations of residuals: what a steady filter with the most likely gain leaves of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.models.sampled.recursion import run_recursion, spectral_radius

Array = NDArray[np.float64]
STEPS, SETTLED = 10, 1e-4
SHARES = (1.0, 0.5, 0.2, 0.05)
"""Steps of the search for a gain, and the gain in log det below which it ends."""
SHOWN = 1e-9
"""Singular value, against the largest, below which outputs do not show a state."""
ORDER = 12
"""Lags of autoregressions."""


def log_size(parts: Sequence[Array]) -> float:
    """Logarithm of the determinant of the covariance."""
    whole = np.concatenate(parts, axis=1)
    return float(np.linalg.slogdet(whole @ whole.T / whole.shape[1])[1])


def innovations(
    residuals: Sequence[Array], systems: Sequence[tuple[Array, Array]]
) -> tuple[list[Array], float]:
    """Errors one sample ahead, v = C x + e, x⁺ = A x + K e, with the most likely K.

    Gauss-Newton on log det of the covariance of e, from a filter of the right sizes.
    """
    gain = _first_gain(*systems[0])
    best = None if gain is None else _ahead(residuals, systems, gain)
    if gain is None or best is None:
        return list(residuals), log_size([each[:, ORDER:] for each in residuals])
    size = log_size([each[:, ORDER:] for each in best])
    for _ in range(STEPS):
        step, before = _step(best, systems, gain), size
        for share in SHARES:
            tried = _ahead(residuals, systems, gain + share * step)
            fresh = np.inf if tried is None else log_size([each[:, ORDER:] for each in tried])
            if tried is not None and fresh < size:
                gain, best, size = gain + share * step, tried, fresh
                break
        if before - size < SETTLED:
            break
    return best, size


def observable(a: Array, c: Array) -> tuple[Array, Array]:
    """The part of a system that its outputs show."""
    rows = [c]
    for _ in range(len(a) - 1):
        rows.append(rows[-1] @ a)
    _, values, right = np.linalg.svd(np.vstack(rows))
    basis = right[: int(np.sum(values > SHOWN * values.max(initial=0.0)))]
    return basis @ a @ basis.T, c @ basis.T


def with_pole(a: Array, c: Array, pole: float) -> tuple[Array, Array]:
    """A system beside a state of that pole for each output: innovations may have it too."""
    n, p = len(a), len(c)
    beside = np.block([[a, np.zeros((n, p))], [np.zeros((p, n)), pole * np.eye(p)]])
    return beside, np.hstack([c, np.eye(p)])


def _first_gain(a: Array, c: Array) -> Array | None:
    """Of a filter whose states move by a tenth of what the outputs show of them."""
    n, p = len(a), len(c)
    shown = np.linalg.norm(c, axis=0)
    moves = np.diag((0.1 / np.where(shown > 0.0, shown, 1.0)) ** 2)
    try:
        covariance = scipy.linalg.solve_discrete_are(
            a.T, c.T, moves + 1e-12 * np.eye(n), 0.5 * np.eye(p)
        )
    except (np.linalg.LinAlgError, ValueError):
        return None
    spread = c @ covariance @ c.T + 0.5 * np.eye(p)
    return np.asarray(np.linalg.solve(spread, c @ covariance @ a.T).T)


def _ahead(
    residuals: Sequence[Array], systems: Sequence[tuple[Array, Array]], gain: Array
) -> list[Array] | None:
    """Innovations; None where that gain is no filter."""
    found = []
    for rows, (a, c) in zip(residuals, systems, strict=True):
        closed = a - gain @ c
        if spectral_radius(closed) >= 1.0:
            return None
        found.append(rows - c @ run_recursion(closed, gain @ rows))
    return found


def _step(errors: Sequence[Array], systems: Sequence[tuple[Array, Array]], gain: Array) -> Array:
    """Step of Gauss-Newton: de/dK_ij = -C x, x⁺ = (A - K C) x + (e_j in state i)."""
    n, p = gain.shape
    spread = np.concatenate(errors, axis=1)
    root = np.linalg.cholesky(spread @ spread.T / spread.shape[1] + 1e-12 * np.eye(p))
    gram, cross = np.zeros((n * p, n * p)), np.zeros(n * p)
    for rows, (a, c) in zip(errors, systems, strict=True):
        driven = np.zeros((n, p, n, rows.shape[1]))
        for state in range(n):
            driven[state, :, state] = rows
        moved = run_recursion(a - gain @ c, driven.reshape(n * p, n, -1))
        columns = (np.linalg.solve(root, c) @ moved)[:, :, ORDER:].reshape(n * p, -1)
        target = np.linalg.solve(root, rows)[:, ORDER:].ravel()
        gram, cross = gram + columns @ columns.T, cross + columns @ target
    size = np.sqrt(np.diag(gram)) + 1e-300
    step = np.linalg.lstsq(gram / np.outer(size, size), cross / size, rcond=1e-9)[0] / size
    return np.asarray(step.reshape(n, p))
