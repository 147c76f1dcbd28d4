"""Upper bound of the structured singular value for independent complex perturbations.

The bound is the least largest singular value of D M D⁻¹ over positive diagonal D; up to three
perturbations it is the structured singular value itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, ShapeError

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
POWERS = (2, 16, 128, 1024)
"""Schatten norms 2p that lead to the largest singular value."""
STEPS = 12
HALVINGS = 20
SETTLED = 1e-4
DIFFERENCE = 1e-5
LARGEST_STEP = 2.0
"""Of a logarithm of a scaling."""
EMPTY = 1e-12
"""Share of the largest entry that stands in for zeros, which would send a scaling to infinity."""


def structured_gain(matrices: ArrayLike) -> Array:
    """Upper bound of μ for a diagonal of independent complex perturbations.

    Parameters
    ----------
    matrices : array_like of complex, shape (..., n, n)

    Returns
    -------
    ndarray, shape (...)

    Raises
    ------
    ShapeError
        Matrices that are not square.
    DataError
        An entry that is not finite.

    Reference
    ---------
    Packard & Doyle, "The complex structured singular value", *Automatica* 29 (1993), theorem 4.6
    (bound) and section 9 (exact up to three blocks). The search runs down Schatten norms, which
    are convex in the logarithms of the scalings by Hadamard's three-line theorem.

    Example
    -------
    >>> float(structured_gain([[0.0, 4.0], [1.0, 0.0]]).round(6))
    2.0
    """
    m = np.asarray(matrices, dtype=np.complex128)
    if m.ndim < 2 or m.shape[-1] != m.shape[-2]:
        raise ShapeError("matrices are not square", found=m.shape, needed="(..., n, n)")
    if not np.all(np.isfinite(m)):
        raise DataError("a matrix is not finite", needed="finite entries")
    lead, n = m.shape[:-2], m.shape[-1]
    rows = m.reshape(-1, n, n)
    if n == 1:
        return np.asarray(np.abs(rows[:, 0, 0]).reshape(lead))
    size = np.max(np.abs(rows), axis=(1, 2))
    scaled = rows / np.where(size > 0.0, size, 1.0)[:, None, None]
    x = np.zeros((len(rows), n))
    filled = np.where(np.abs(scaled) < EMPTY, EMPTY, scaled)
    best = _largest(scaled, x)
    for power in POWERS:
        x = _newton(filled, x, power)
        best = np.minimum(best, _largest(scaled, x))
    return np.asarray((best * size).reshape(lead))


def _scaled(m: Complex, x: Array) -> Complex:
    return np.asarray(np.exp(x[:, :, None] - x[:, None, :]) * m)


def _largest(m: Complex, x: Array) -> Array:
    return np.asarray(np.linalg.norm(_scaled(m, x), ord=2, axis=(1, 2)))


def _height(m: Complex, x: Array, power: int) -> Array:
    """Logarithm of the Schatten norm 2p."""
    values = np.linalg.svd(_scaled(m, x), compute_uv=False)
    top = values[:, :1]
    total = np.sum((values / top) ** (2 * power), axis=1)
    return np.asarray(np.log(top[:, 0]) + np.log(total) / (2.0 * power))


def _slope(m: Complex, x: Array, power: int) -> Array:
    """Gradient of the height by the logarithms of the scalings."""
    left, values, right = np.linalg.svd(_scaled(m, x))
    weight = (values / values[:, :1]) ** (2 * power)
    weight /= np.sum(weight, axis=1, keepdims=True)
    rows = np.einsum("fik,fk->fi", np.abs(left) ** 2, weight)
    columns = np.einsum("fki,fk->fi", np.abs(right) ** 2, weight)
    return np.asarray(rows - columns)


def _newton(m: Complex, x: Array, power: int) -> Array:
    """Damped Newton steps, each matrix on its own; the last scaling stays as it is."""
    n = x.shape[1]
    free = n - 1
    active = np.arange(len(x))
    for _ in range(STEPS):
        part, at = m[active], x[active]
        slope = _slope(part, at, power)
        bend = np.empty((len(active), free, free))
        for k in range(free):
            shift = np.zeros(n)
            shift[k] = DIFFERENCE
            ends = _slope(part, at + shift, power) - _slope(part, at - shift, power)
            bend[:, :, k] = ends[:, :free] / (2.0 * DIFFERENCE)
        bend = (bend + np.swapaxes(bend, 1, 2)) / 2.0
        sizes, turn = np.linalg.eigh(bend)
        least = 1e-6 * np.maximum(np.abs(sizes).max(axis=1, keepdims=True), 1e-6)
        inside = np.einsum("fki,fk->fi", turn, slope[:, :free]) / np.maximum(sizes, least)
        step = np.zeros_like(at)
        step[:, :free] = -np.einsum("fik,fk->fi", turn, inside)
        step /= np.maximum(1.0, np.abs(step).max(axis=1, keepdims=True) / LARGEST_STEP)
        x[active], moved = _descended(part, at, step, power)
        active = active[moved > SETTLED]
        if not len(active):
            break
    return x


def _descended(m: Complex, x: Array, step: Array, power: int) -> tuple[Array, Array]:
    """The step, halved until it descends; how far it went."""
    before = _height(m, x, power)
    share = np.ones(len(x))
    for _ in range(HALVINGS):
        higher = _height(m, x + share[:, None] * step, power) > before
        if not np.any(higher):
            break
        share[higher] /= 2.0
    share[_height(m, x + share[:, None] * step, power) > before] = 0.0
    moved = share[:, None] * step
    return x + moved, np.abs(moved).max(axis=1)
