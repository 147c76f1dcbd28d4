"""Gain of the predictor, and input matrices once A and C are known."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError, FitError
from flightid.identification.subspace.data import SubspaceData
from flightid.models.sampled.recursion import spectral_radius
from flightid.uncertainty.triangle import triangle_of_rows

Array = NDArray[np.float64]
STABLE = 1.0 - 1e-6
INSIDE = 1.0 - 1e-3
"""Size of a pole that was at the circle."""
NOISELESS = 1e-16
"""Innovations with less than this share of the outputs' power are rounding."""
SPENT = 1e-20
"""Largest entry of a transition's power that leaves nothing of a state."""


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
    own_forced, own_shown = own_columns(closed, c, k, m, levels=data.channels.levels)
    records, own = len(data.outputs), len(own_forced)
    forced, shown = (
        np.concatenate([np.zeros((n_free, *each.shape[1:])), each, np.zeros((1, *each.shape[1:]))])
        for each in (own_forced, own_shown)
    )
    for i, j in np.ndindex(n, m):
        forced[i * m + j, i, j] = -1.0
    for o, j in np.ndindex(p if direct else 0, m):
        forced[n * m + o * m + j, :, j] = k[:, o]
        shown[n * m + o * m + j, o, j] = 1.0
    # Last the outputs themselves, as the predictor leaves them without inputs.
    forced[-1, :, m : m + p], shown[-1, :, m : m + p] = k, np.eye(p)
    rows = []
    for place, (y, u) in enumerate(zip(data.outputs, data.inputs, strict=True)):
        try:
            made = run_columns(closed, c, (forced, shown), y, u)
        except DataError:
            poles = np.abs(np.linalg.eigvals(closed)).max()
            raise FitError(
                "a subspace model's predictions run away over the records",
                found=f"order {n}, predictor poles up to {poles:.3g}",
                action="choose another order, or look for outliers and unlike scales in the "
                "records",
            ) from None
        triangle = triangle_of_rows(made.reshape(y.size, -1))
        wide = np.zeros((len(triangle), n_free + own * records + 1))
        wide[:, :n_free], wide[:, -1] = triangle[:, :n_free], triangle[:, -1]
        first = n_free + own * place
        wide[:, first : first + own] = triangle[:, n_free:-1]
        rows.append(wide)
    whole = np.concatenate(rows)
    poor = np.finfo(float).eps * sum(y.size for y in data.outputs)
    found = np.linalg.lstsq(whole[:, :-1], whole[:, -1], rcond=poor)[0]
    d = found[n * m : n_free].reshape(p, m) if direct else np.zeros((p, m))
    return found[: n * m].reshape(n, m), d


def own_columns(
    closed: Array, c: Array, k: Array, m: int, *, levels: bool, start: bool = True
) -> tuple[Array, Array]:
    """What a record's own numbers push and show of a predictor: initial states, then levels.

    Returns
    -------
    tuple of ndarray, shapes (n_own, n, q) and (n_own, p, q)
        By the signals of `run_columns`.
    """
    (p, n), at = c.shape, m + len(c)
    first = n if start else 0
    count = first + (p if levels else 0)
    forced, shown = np.zeros((count, n, at + 2)), np.zeros((count, p, at + 2))
    if start:
        forced[:n, :, at], shown[:n, :, at] = -closed.T, c.T
    if levels:
        forced[first:, :, at + 1], shown[first:, :, at + 1] = k.T, np.eye(p)
    return forced, shown


def run_columns(closed: Array, c: Array, columns: tuple[Array, Array], y: Array, u: Array) -> Array:
    """G s − C x with x⁺ = Ā x + F s for several F and G, shape (n_samples, p, n_columns).

    The signals s are inputs, outputs, a one at the first sample, and ones. Columns that the first
    sample alone drives are run until nothing is left of them.
    """
    begun = np.zeros((2, y.shape[1]))
    begun[0, :1], begun[1] = 1.0, 1.0
    signals, lasting = np.concatenate([u, y, begun]), _lasting(closed, y.shape[1])
    once = len(signals) - len(begun)
    brief = ~np.any([np.delete(each, once, axis=2).any(axis=(1, 2)) for each in columns], axis=0)
    return _native.slope_recursion(closed, c, *columns, signals, brief.tolist(), lasting)


def _lasting(closed: Array, most: int) -> int:
    """Samples after which nothing is left of a state, to rounding; `most` where it goes on."""
    samples, power = 1, closed
    with np.errstate(over="ignore", invalid="ignore"):
        while samples < most and not np.abs(power).max(initial=0.0) < SPENT:
            samples, power = 2 * samples, power @ power
    return min(samples, most)
