"""Fourier transforms of overlapped Hann windows at arbitrary frequencies, as matrix products.

A Hann window is even about its middle, so each frame is folded there: its even part meets cosines
and its odd part sines, which halves the work of the matrix product. Every number is the exact
transform at the frequency that was asked for; no frequency is rounded to a grid of the window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

HANN_POWER = 3.0 / 8.0
"""Mean square of the (periodic) Hann window: what U is in the one-sided spectra."""


@dataclass(frozen=True)
class WindowPlan:
    """One window length: samples in a window and samples from one window to the next.

    Attributes
    ----------
    length : int
        Samples in the window: even, and a multiple of `shifts`.
    shifts : int
        Hops in one window: 2 for 50 % overlap, 5 for 80 %, 1 for none.
    """

    length: int
    shifts: int

    @property
    def hop(self) -> int:
        """Samples from the start of one window to the start of the next."""
        return self.length // self.shifts

    def count(self, n_samples: int) -> int:
        """Windows that lie wholly inside a record of so many samples."""
        return max(0, (n_samples - self.length) // self.hop + 1)

    def independent(self, n_samples: int) -> float:
        """Windows without overlap that would cover the same samples."""
        count = self.count(n_samples)
        return 0.0 if count == 0 else 1.0 + (count - 1) / self.shifts

    def taper(self) -> NDArray[np.float64]:
        """The periodic Hann window, shape (length,)."""
        return 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(self.length) / self.length)


@dataclass(frozen=True)
class FoldedBasis:
    """Tapered cosines and sines about the middle of a window, for one set of frequencies.

    Attributes
    ----------
    cosine, sine : ndarray, shape (n_f, length // 2 + 1)
        Rows belong to frequencies, columns to distances 0 … length/2 from the middle.
    """

    plan: WindowPlan
    cosine: NDArray[np.float64]
    sine: NDArray[np.float64]

    @classmethod
    def of(cls, plan: WindowPlan, omega: NDArray[np.float64]) -> FoldedBasis:
        """Basis for `omega` in rad per sample."""
        distance = np.arange(plan.length // 2 + 1)
        taper = 0.5 + 0.5 * np.cos(2.0 * np.pi * distance / plan.length)
        angle = np.multiply.outer(omega, distance)
        return cls(plan, np.cos(angle) * taper, np.sin(angle) * taper)


def frames(
    samples: NDArray[np.float64], plan: WindowPlan, detrend: str = "none"
) -> NDArray[np.float64]:
    """Windows of each channel before tapering.

    Parameters
    ----------
    samples : ndarray, shape (n_channels, n_samples)
    plan : WindowPlan
    detrend : {"none", "mean", "line"}
        What is removed from each window by itself.

    Returns
    -------
    ndarray, shape (n_channels, n_windows, length)
        A read-only view where nothing is removed.
    """
    view = sliding_window_view(samples, plan.length, axis=1)[:, :: plan.hop]
    if detrend == "none":
        return view
    removed = view - view.mean(axis=2, keepdims=True)
    if detrend == "line":
        slope = np.arange(plan.length) - (plan.length - 1) / 2.0
        removed -= (removed @ slope / (slope @ slope))[:, :, None] * slope
    return np.asarray(removed)


def transform(
    samples: NDArray[np.float64], basis: FoldedBasis, detrend: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Transform of every window of every channel, time counted from the window's middle.

    Parameters
    ----------
    samples : ndarray, shape (n_channels, n_samples)
    basis : FoldedBasis
    detrend : {"none", "mean", "line"}

    Returns
    -------
    tuple of ndarray, each shape (n_f, n_channels, n_windows)
        Real and imaginary parts of ``Σ w(t) x(t) exp(−jωt)``.
    """
    window = frames(samples, basis.plan, detrend)
    channels, count, length = window.shape
    half = length // 2
    even = np.empty((channels, count, half + 1))
    odd = np.empty_like(even)
    right, left = window[:, :, half + 1 :], window[:, :, half - 1 : 0 : -1]
    np.add(right, left, out=even[:, :, 1:half])
    np.subtract(right, left, out=odd[:, :, 1:half])
    even[:, :, 0], odd[:, :, 0] = window[:, :, half], 0.0
    # The window's first sample stands alone: its mirror image is the next window's first.
    even[:, :, half], odd[:, :, half] = window[:, :, 0], -window[:, :, 0]
    shape = (len(basis.cosine), channels, count)
    rows = channels * count
    real = basis.cosine @ even.reshape(rows, half + 1).T
    imaginary = -(basis.sine @ odd.reshape(rows, half + 1).T)
    return real.reshape(shape), imaginary.reshape(shape)
