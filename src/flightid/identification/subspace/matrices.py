"""Gain of the predictor, and input matrices once A and C are known."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import DataError, FitError
from flightid.identification.subspace.data import SubspaceData
from flightid.identification.subspace.predictor_columns import InputColumns
from flightid.models.sampled.recursion import spectral_radius

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
) -> tuple[Array, Array, float]:
    """B and D by least squares on the errors of the predictor, which are linear in them.

    Beside them the squares of what is left.

    The predictor is stable where the model is not, so records may be long. Initial states of the
    records are fitted beside.
    """
    n, p, m = a.shape[0], data.n_outputs, data.n_inputs
    closed, levels = a - k @ c, data.channels.levels
    columns = InputColumns(closed, c, k, direct, levels)
    n_free, own = n * m + p * m * direct, n + p * levels
    rows = []
    for place, (y, u) in enumerate(zip(data.outputs, data.inputs, strict=True)):
        try:
            triangle = columns.triangle(y, u)
        except DataError:
            poles = np.abs(np.linalg.eigvals(closed)).max()
            raise FitError(
                "a subspace model's predictions run away over the records",
                found=f"order {n}, predictor poles up to {poles:.3g}",
                action="choose another order, or look for outliers and unlike scales in the "
                "records",
            ) from None
        wide = np.zeros((len(triangle), n_free + own * len(data.outputs) + 1))
        wide[:, :n_free], wide[:, -1] = triangle[:, :n_free], triangle[:, -1]
        first = n_free + own * place
        wide[:, first : first + own] = triangle[:, n_free:-1]
        rows.append(wide)
    whole = np.concatenate(rows)
    poor = np.finfo(float).eps * sum(y.size for y in data.outputs)
    found = np.linalg.lstsq(whole[:, :-1], whole[:, -1], rcond=poor)[0]
    squares = float(np.sum((whole[:, -1] - whole[:, :-1] @ found) ** 2))
    d = found[n * m : n_free].reshape(p, m) if direct else np.zeros((p, m))
    return found[: n * m].reshape(n, m), d, squares
