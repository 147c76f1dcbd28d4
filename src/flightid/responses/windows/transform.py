"""Fourier transforms of overlapped Hann windows at arbitrary frequencies, as matrix products.

A Hann window is even about its middle, so each frame is folded there: its even part meets cosines
and its odd part sines, which halves the work of the matrix product. Every number is the exact
transform at the frequency that was asked for; no frequency is rounded to a grid of the window.

Slow frequencies do not need every sample: on a panel of samples all slow sinusoids, tapered or not,
lie in a space of few dimensions. Frames are projected on it, panel by panel, before their product.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

PANEL = 128
"""Samples in a panel of a folded frame."""
SLOW = 0.25
"""Highest frequency of the panels' space, rad per sample."""
PANEL_TOLERANCE = 1e-12
"""Largest share of a slow sinusoid that its projection may miss."""
FEWEST_SLOW = 50
"""Slow frequencies from which on the projection pays."""
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
    cosine, sine : ndarray, shape (n_f − n_slow, half + 1)
        Columns belong to distances 0 … length/2 from the middle.
    slow_cosine, slow_sine : ndarray, shape (n_slow, n_panels · rank)
        Of the slow frequencies at the head, on the panels' space.
    """

    plan: WindowPlan
    cosine: NDArray[np.float64]
    sine: NDArray[np.float64]
    slow_cosine: NDArray[np.float64]
    slow_sine: NDArray[np.float64]

    @property
    def n_slow(self) -> int:
        """Leading frequencies that are worked on by panels."""
        return len(self.slow_cosine)

    @property
    def n_frequencies(self) -> int:
        """All frequencies."""
        return len(self.slow_cosine) + len(self.cosine)

    @classmethod
    def of(cls, plan: WindowPlan, omega: NDArray[np.float64]) -> FoldedBasis:
        """Basis for `omega` in rad per sample."""
        size = plan.length // 2 + 1
        fast = np.flatnonzero(omega + 2.0 * np.pi / plan.length > SLOW)
        n_slow = int(fast[0]) if fast.size else len(omega)
        if n_slow < FEWEST_SLOW or size < 2 * PANEL:
            n_slow = 0
        # Frames are zero beyond half a window; the basis goes on, for a cut leaves the space.
        width = -(-size // PANEL) * PANEL
        slow = _tapered(plan, omega[:n_slow], width)
        rest = _tapered(plan, omega[n_slow:], size)
        return cls(
            plan, rest.real.copy(), rest.imag.copy(), _project(slow.real), _project(slow.imag)
        )


def _tapered(plan: WindowPlan, omega: NDArray[np.float64], count: int) -> NDArray[np.complex128]:
    """Tapered ``exp(jωd)`` for distances d from 0 to `count` − 1."""
    taper = 0.5 + 0.5 * np.cos(2.0 * np.pi * np.arange(count) / plan.length)
    return _exponentials(omega, count) * taper


def _exponentials(omega: NDArray[np.float64], count: int) -> NDArray[np.complex128]:
    """``exp(jωd)`` for d below `count`, from two short tables: coarse steps and fine ones."""
    fine = int(np.ceil(np.sqrt(count)))
    coarse = -(-count // fine)
    small = np.exp(1j * np.multiply.outer(omega, np.arange(fine)))
    large = np.exp(1j * np.multiply.outer(omega, fine * np.arange(coarse)))
    whole = (large[:, :, None] * small[:, None, :]).reshape(len(omega), coarse * fine)
    return np.asarray(whole[:, :count])


@cache
def _panel_space() -> NDArray[np.float64]:
    """Orthonormal basis of all sinusoids up to `SLOW` on one panel, shape (PANEL, rank)."""
    place = np.arange(PANEL) - (PANEL - 1) / 2.0
    angle = np.multiply.outer(place, SLOW * np.linspace(0.0, 1.0, PANEL))
    u, s, _ = np.linalg.svd(np.concatenate([np.cos(angle), np.sin(angle)], axis=1))
    return np.ascontiguousarray(u[:, : int(np.sum(s > PANEL_TOLERANCE * s[0]))])


def _project(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of whole panels on the panels' space, shape (n_rows, n_panels · rank)."""
    space = _panel_space()
    panels = rows.shape[1] // PANEL
    return np.asarray((rows.reshape(-1, PANEL) @ space).reshape(len(rows), panels * space.shape[1]))


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
    even, odd = _fold(window, -(-(length // 2 + 1) // PANEL) * PANEL if basis.n_slow else 0)
    shape = (basis.n_frequencies, channels, count)
    real = _product(basis.slow_cosine, basis.cosine, even)
    imaginary = _product(basis.slow_sine, basis.sine, odd)
    return real.reshape(shape), np.negative(imaginary, out=imaginary).reshape(shape)


def _fold(
    window: NDArray[np.float64], at_least: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Even and odd parts about the middle, shape (n_rows, distances), zeros up to `at_least`."""
    channels, count, length = window.shape
    half = length // 2
    width = max(half + 1, at_least)
    even = np.empty((channels, count, width))
    odd = np.empty_like(even)
    right, left = window[:, :, half + 1 :], window[:, :, half - 1 : 0 : -1]
    np.add(right, left, out=even[:, :, 1:half])
    np.subtract(right, left, out=odd[:, :, 1:half])
    even[:, :, 0], odd[:, :, 0] = window[:, :, half], 0.0
    # The window's first sample stands alone: its mirror image is the next window's first.
    even[:, :, half], odd[:, :, half] = window[:, :, 0], -window[:, :, 0]
    even[:, :, half + 1 :], odd[:, :, half + 1 :] = 0.0, 0.0
    return even.reshape(-1, width), odd.reshape(-1, width)


def _product(
    slow: NDArray[np.float64], fast: NDArray[np.float64], rows: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Slow rows of a basis with the projected rows, fast ones with the rows themselves."""
    found = np.empty((len(slow) + len(fast), len(rows)))
    if len(slow):
        np.matmul(slow, _project(rows).T, out=found[: len(slow)])
    np.matmul(fast, rows[:, : fast.shape[1]].T, out=found[len(slow) :])
    return found
