"""Transforms of windows at the bins of the noise, and the kernels that weights make of them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

KEPT = 256
"""Transforms of a window that are kept: one fit asks several times for the same."""
SMALL = 1e-9
"""Sine of half an angle below which a sum over a window is its length: of 1e-5 samples at most."""
Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@lru_cache(KEPT)
def kept_turns(middle: int, hop: int, count: int, angle: bytes) -> Complex:
    """Transform of unit samples at the windows' middles, shape (n_windows, n_angles).

    Windows are copies of one basis function, so the transform of g is that of the windows' weights
    at their places times the function's.

    Parameters
    ----------
    middle, hop, count : int
        Place of the first window's middle, samples from one to the next, windows.
    angle : bytes
        Of float64, rad per sample.
    """
    middles = middle + hop * np.arange(count)
    found = np.exp(-1j * np.multiply.outer(middles, np.frombuffer(angle)))
    found.setflags(write=False)
    return np.asarray(found)


@lru_cache(KEPT)
def kept_transforms(
    length: int, omega: bytes, angle: bytes, detrend: str
) -> tuple[Complex, Complex]:
    """Half the sum of a window's transform and its mirror image; j times half the difference.

    Parameters
    ----------
    length : int
        Samples.
    omega, angle : bytes
        Of float64, rad per sample: frequencies of the estimate, bins of the noise.
    detrend : {"none", "mean", "line"}

    Returns
    -------
    tuple of ndarray, each shape (n_omega, n_angle)
    """
    at, angles = np.frombuffer(omega), np.frombuffer(angle)
    above = basis_transform(length, at, angles, detrend)
    below = basis_transform(length, at, -angles, detrend).conj()
    found = (above + below) / 2.0, 0.5j * (above - below)
    for each in found:
        each.setflags(write=False)
    return found


def mirrored_kernels(
    weights: Complex, turns: Complex, both: tuple[Complex, Complex], into: Complex
) -> None:
    """Kernels of real and of imaginary parts, from real products: half those of complex ones.

    Parameters
    ----------
    weights : ndarray, shape (n_in, n_near, n_windows)
    turns : ndarray, shape (n_windows, n_bins)
    both : tuple of ndarray, each shape (n_near, n_bins)
        See `kept_transforms`.
    into : ndarray, shape (n_in, n_near, 2, n_bins)
    """
    parts = np.concatenate([weights.real, weights.imag]) @ turns.view(np.float64)
    real, imaginary = parts.view(np.complex128).reshape(2, *into.shape[:2], -1)
    same, apart = both
    np.multiply(real, same, out=into[:, :, 0])
    into[:, :, 0] += imaginary * apart
    np.multiply(imaginary, same, out=into[:, :, 1])
    into[:, :, 1] -= real * apart


def basis_transform(length: int, omega: Real, angle: Real, detrend: str) -> Complex:
    """Transform of the tapered, detrended exponential about the window's middle.

    Parameters
    ----------
    length : int
    omega, angle : ndarray
        Rad per sample.
    detrend : {"none", "mean", "line"}

    Returns
    -------
    ndarray of complex, shape (n_omega, n_angle)
    """
    found = _hann(length, omega, angle)
    if detrend == "none":
        return found
    flat = _dirichlet(length, angle)
    found = found - np.multiply.outer(_hann(length, omega, np.zeros(1))[:, 0] / length, flat)
    if detrend == "line":
        norm = length * (length**2 - 1.0) / 12.0
        found = found - np.multiply.outer(_hann_slope(length, omega) / norm, _slope(length, angle))
    return found


def _dirichlet(length: int, x: Real) -> Complex:
    """``Σ exp(−jxm)`` over m = −length/2 … length/2 − 1."""
    half = np.sin(x / 2.0)
    small = np.abs(half) < SMALL
    ratio = np.sin(length * x / 2.0) / np.where(small, 1.0, half)
    return np.asarray(np.exp(0.5j * x) * np.where(small, length, ratio))


def _hann(length: int, omega: Real, angle: Real) -> Complex:
    """Transform of a Hann window at all sums of two angles, sines of sums from those of parts."""
    turn = np.multiply.outer(np.exp(0.5j * omega), np.exp(0.5j * angle))
    wide = np.multiply.outer(np.exp(0.5j * length * omega), np.exp(0.5j * length * angle)).imag
    found = 0.5 * _ratio(wide, turn.imag, length)
    step = np.exp(1j * np.pi / length)
    for shift in (step, step.conjugate()):
        # A bin to the side the numerator has the other sign.
        sine = turn.imag * shift.real + turn.real * shift.imag
        found = found + 0.25 * shift * _ratio(-wide, sine, length)
    return np.asarray(turn * found)


def _ratio(above: Real, below: Real, length: int) -> Real:
    """Quotient of two sines, which is the length where both vanish."""
    small = np.abs(below) < SMALL
    return np.where(small, length, above / np.where(small, 1.0, below))


def _slope(length: int, x: Real) -> Complex:
    """``Σ (m + ½) exp(−jxm)``: the derivative of the sum above."""
    half, wide = x / 2.0, length * x / 2.0
    small = np.abs(np.sin(half)) < 1e-12
    below = np.where(small, 1.0, np.sin(half) ** 2)
    above = 0.5 * length * np.cos(wide) * np.sin(half) - 0.5 * np.sin(wide) * np.cos(half)
    return np.asarray(1j * np.exp(1j * half) * np.where(small, 0.0, above / below))


def _hann_slope(length: int, x: Real) -> Complex:
    step = 2.0 * np.pi / length
    sides = _slope(length, x - step) + _slope(length, x + step)
    return 0.5 * _slope(length, x) + 0.25 * sides
