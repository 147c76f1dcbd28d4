"""The steady Kalman filter of a linear model with process noise, and its exact derivatives.

ẋ = A x + w, y = C x + v, sampled; inputs add what `records/held_model.py` says and move no
covariance. The predicted covariance P solves the discrete Riccati equation; its derivative solves a
Lyapunov equation of the closed filter, since at its optimum the gain does not move P to first
order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import FitError
from flightid.frozen import dataclass

Array = NDArray[np.float64]
_DOUBLINGS = 60
_SETTLED = 1e-14
_LARGEST = 1e60


@dataclass(frozen=True)
class ContinuousPoint:
    """A linear model with its noise at one point, or the derivative of all by one parameter.

    Attributes
    ----------
    a, c : ndarray
        State space, (n, n), (p, n).
    process : ndarray, shape (n, n)
        Spectral density W of the process noise, two-sided, state unit² / s³ per unit of ẋ².
    measurement : ndarray, shape (p, p)
        Covariance R of the measurement noise.
    """

    a: Array
    c: Array
    process: Array
    measurement: Array


@dataclass(frozen=True)
class SteadyFilter:
    """One-step predictor x⁺ = Ā x + L z + q with z = y − v and ε = z − C x, v and q of the inputs.

    Attributes
    ----------
    closed : ndarray, shape (n, n)
        Ā = Φ − L C.
    gain : ndarray, shape (n, p)
        L.
    c : ndarray, shape (p, n)
    innovation : ndarray, shape (p, p)
        Covariance B of ε.
    predicted : ndarray, shape (n, n)
        Covariance P of the predicted state.
    """

    closed: Array
    gain: Array
    c: Array
    innovation: Array
    predicted: Array


def steady_filter(
    point: ContinuousPoint, slopes: Sequence[ContinuousPoint], sample_time_s: float
) -> tuple[SteadyFilter, SteadyFilter]:
    """Filter at a point and its derivative by each parameter.

    Parameters
    ----------
    point : ContinuousPoint
    slopes : sequence of ContinuousPoint
        Derivatives of every matrix by each parameter.
    sample_time_s : float

    Returns
    -------
    tuple of SteadyFilter and SteadyFilter
        The second holds the derivatives, by parameter along a first axis of each matrix.

    Raises
    ------
    FitError
        There is no steady filter: an unstable part that no output sees.

    Reference
    ---------
    Maine & Iliff, NASA RP 1168, §7; Jategaonkar, *Flight Vehicle System Identification*, §5.3
    (innovations form); Van Loan (1978), IEEE Trans. Automatic Control 23 (integrals); Chu, Fan,
    Lin & Wang (2004), Int. J. Control 77 (doubling for the Riccati equation).

    Example
    -------
    >>> one = np.eye(1)
    >>> walk = ContinuousPoint(0 * one, one, one, 2 * one)
    >>> steady_filter(walk, [], 1.0)[0].predicted
    array([[2.]])
    """
    n = len(point.a)
    noisy = _noisy(point, sample_time_s)
    exponent = point.a * sample_time_s
    phi, spread = _native.matrix_exponential(exponent), _native.matrix_exponential(noisy)
    q = _symmetric(phi @ spread[:n, n:])
    predicted = _riccati(phi, point.c, q, point.measurement)
    innovation = point.c @ predicted @ point.c.T + point.measurement
    weight = np.linalg.solve(innovation, point.c @ predicted).T
    keep = np.eye(n) - weight @ point.c
    filtered = _symmetric(keep @ predicted)
    gain = phi @ weight
    found = SteadyFilter(phi @ keep, gain, point.c, innovation, predicted)
    pairs = [_carried(point, noisy, spread, slope, sample_time_s) for slope in slopes]
    d_phi, d_q = (np.array([pair[k] for pair in pairs]).reshape(-1, n, n) for k in range(2))
    d_c = np.array([slope.c for slope in slopes]).reshape(-1, *point.c.shape)
    d_r = np.array([slope.measurement for slope in slopes]).reshape(-1, *innovation.shape)
    d_q = _symmetric(d_phi @ spread[:n, n:] + phi @ d_q)
    turned = weight @ d_c @ predicted @ keep.T
    kept = weight @ d_r @ weight.T - turned - _turned(turned)
    carried = d_phi @ filtered @ phi.T
    d_predicted = _lyapunov(found.closed, phi @ kept @ phi.T + carried + _turned(carried) + d_q)
    cross = d_c @ predicted @ point.c.T
    d_innovation = point.c @ d_predicted @ point.c.T + cross + _turned(cross) + d_r
    d_product = d_predicted @ point.c.T + predicted @ _turned(d_c)
    inverse = np.linalg.inv(innovation)
    d_gain = d_phi @ weight + phi @ ((d_product - weight @ d_innovation) @ inverse)
    d_closed = d_phi - d_gain @ point.c - gain @ d_c
    return found, SteadyFilter(d_closed, d_gain, d_c, d_innovation, d_predicted)


def _carried(
    point: ContinuousPoint, noisy: Array, spread: Array, slope: ContinuousPoint, step: float
) -> tuple[Array, Array]:
    """Derivatives of Φ and of the block that spreads the noise."""
    n = len(point.a)
    if np.any(slope.a):
        return _moved(point.a * step, slope.a * step), _moved(noisy, _noisy(slope, step))[:n, n:]
    if not np.any(slope.process):
        return np.zeros((n, n)), np.zeros_like(spread[:n, n:])
    # The upper right block is linear in the noise, all others do not hold it.
    alone = _noisy(replace(point, process=slope.process), step)
    return np.zeros((n, n)), _native.matrix_exponential(alone)[:n, n:]


def _moved(exponent: Array, direction: Array) -> Array:
    """Derivative of an exponential along a direction: the corner of a larger one (Van Loan)."""
    n = len(exponent)
    both = np.zeros((2 * n, 2 * n))
    both[:n, :n] = both[n:, n:] = exponent
    both[:n, n:] = direction
    return _native.matrix_exponential(both)[:n, n:]


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + _turned(matrix))


def _turned(matrices: Array) -> Array:
    return np.asarray(matrices.swapaxes(-1, -2))


def _noisy(point: ContinuousPoint, step: float) -> Array:
    n = len(point.a)
    result = np.zeros((2 * n, 2 * n))
    result[:n, :n], result[n:, n:] = -point.a * step, point.a.T * step
    result[:n, n:] = point.process * step
    return result


def _riccati(phi: Array, c: Array, q: Array, r: Array) -> Array:
    """Stabilising P = Φ (P − P Cᵀ (C P Cᵀ + R)⁻¹ C P) Φᵀ + Q by doubling."""
    n, one = len(phi), np.eye(len(phi))
    a, g, h = phi.T.copy(), c.T @ np.linalg.solve(r, c), q.copy()
    size = float(np.abs(h).max(initial=0.0))
    for _ in range(_DOUBLINGS):
        if not size < _LARGEST:
            break
        both = np.linalg.solve(one + g @ h, np.concatenate([a, g], axis=1))
        turned, shared = both[:, :n], both[:, n:]
        change = a.T @ h @ turned
        g = _symmetric(g + a @ shared @ a.T)
        h = _symmetric(h + change)
        a = a @ turned
        size = float(np.abs(h).max(initial=0.0))
        if float(np.abs(change).max(initial=0.0)) <= _SETTLED * max(size, 1e-300):
            return h
    raise FitError(
        "the model has no steady filter",
        found="a Riccati equation that does not settle",
        needed="outputs that see every unstable part of the model",
        action="measure more outputs, or drop the states that no output shows",
    )


def _lyapunov(closed: Array, source: Array) -> Array:
    """X = Ā X Āᵀ + S by doubling, for each of the sources S."""
    result, power = _symmetric(source), closed
    for _ in range(_DOUBLINGS):
        change = power @ result @ power.T
        result = result + change
        left, size = (np.abs(each).max(axis=(1, 2), initial=0.0) for each in (change, result))
        if np.all(left <= _SETTLED * np.maximum(size, 1e-300)):
            break
        power = power @ power
    return np.asarray(result)
