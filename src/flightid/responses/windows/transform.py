"""Fourier transforms of overlapped Hann windows at arbitrary frequencies, as matrix products.

A Hann window is even about its middle, so each frame is folded there: its even part meets cosines
and its odd part sines, which halves the work of the matrix product. Every number is the exact
transform at the frequency that was asked for; no frequency is rounded to a grid of the window.

Slow frequencies do not need every sample: see `panels`. A mean that is removed from each window is
taken out of the basis instead, once.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass
from flightid.responses.windows.panels import PanelBasis, PanelSpace, exponentials, panel_levels

HANN_POWER = 3.0 / 8.0
"""Mean square of the (periodic) Hann window: what U is in the one-sided spectra."""
SMALL = 1e-9
"""Sine of half an angle below which a sum over a window is its length."""
Real = NDArray[np.float64]


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
    plan : WindowPlan
    detrend : {"none", "mean", "line"}
        What is removed from each window by itself.
    cosine, sine : ndarray, shape (n_f − slow ones, half + 1)
        Of the fast frequencies; columns belong to distances 0 … length/2 from the middle.
    slow : tuple of PanelBasis
        Of the slow frequencies at the head, slowest first; the first level of panels is last.
    """

    plan: WindowPlan
    detrend: str
    cosine: Real
    sine: Real
    slow: tuple[PanelBasis, ...]

    @property
    def n_frequencies(self) -> int:
        """All frequencies."""
        return sum(len(each.cosine) for each in self.slow) + len(self.cosine)

    @property
    def n_bytes(self) -> int:
        """Memory of its numbers."""
        parts: list[FoldedBasis | PanelBasis] = [self, *self.slow]
        return sum(each.cosine.nbytes + each.sine.nbytes for each in parts)

    @classmethod
    def of(cls, plan: WindowPlan, omega: Real, detrend: str = "none") -> FoldedBasis:
        """Basis for `omega` in rad per sample, increasing."""
        size = plan.length // 2 + 1
        bend = 2.0 * np.pi / plan.length
        level = np.zeros(len(omega))
        if detrend == "mean":
            level = _taper_transform(plan, omega) / plan.length
        slow, start = [], 0
        levels = panel_levels(omega + bend, size)
        width = -(-size // levels[0][0].size) * levels[0][0].size if levels else 0
        for space, stop in levels:
            part = slice(start, stop)
            count = width // space.size
            slow.append(_on_panels(space, count, omega[part], level[part], bend))
            start = stop
        rest = exponentials(omega[start:], size)
        rest *= 0.5 + 0.5 * np.cos(bend * np.arange(size))
        cosine = rest.real - level[start:, None]
        return cls(plan, detrend, cosine, rest.imag.copy(), tuple(slow))


def _taper_transform(plan: WindowPlan, omega: Real) -> Real:
    """``Σ w(d) cos ωd`` over a window, time counted from its middle."""
    half = plan.length // 2
    bend = np.pi / half
    total = np.zeros_like(omega)
    for weight, angle in ((0.5, omega), (0.25, omega + bend), (0.25, omega - bend)):
        small = np.abs(np.sin(0.5 * angle)) < SMALL
        safe = np.where(small, 1.0, angle)
        total += weight * np.where(small, 2.0 * half, np.sin(half * safe) / np.tan(0.5 * safe))
    return total


def _on_panels(space: PanelSpace, count: int, omega: Real, level: Real, bend: float) -> PanelBasis:
    """Tapered sinusoids less their level, on the panels of a folded frame."""
    found: NDArray[np.complex128] = 0.5 * space.sinusoids(omega, count)
    found += 0.25 * space.sinusoids(omega + bend, count)
    found += 0.25 * space.sinusoids(omega - bend, count)
    cosine = found.real - level[:, None] * space.sinusoids(np.zeros(1), count).real
    return PanelBasis(space, cosine, found.imag.copy())


def frames(samples: Real, plan: WindowPlan, detrend: str = "none") -> Real:
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


def transform(samples: Real, basis: FoldedBasis) -> tuple[Real, Real]:
    """Transform of every window of every channel, time counted from the window's middle.

    Parameters
    ----------
    samples : ndarray, shape (n_channels, n_samples)
    basis : FoldedBasis

    Returns
    -------
    tuple of ndarray, each shape (n_f, n_channels, n_windows)
        Real and imaginary parts of ``Σ w(t) x(t) exp(−jωt)``.
    """
    count = basis.plan.count(samples.shape[1])
    parts = np.empty((basis.n_frequencies, 2, count, samples.shape[0]))
    transform_into(samples, basis, parts)
    real, imaginary = parts[:, 0].transpose(0, 2, 1), parts[:, 1].transpose(0, 2, 1)
    return real, imaginary


def transform_into(samples: Real, basis: FoldedBasis, parts: Real) -> None:
    """As `transform`, into rows that are there, shape (n_f, 2, n_windows, n_channels).

    Windows come before channels, so that the windows of several records lie side by side.
    """
    length, hop = basis.plan.length, basis.plan.hop
    if basis.detrend == "line":
        # Each has a line of its own: frames, one after another, as channels of one window.
        window = frames(samples, basis.plan, "line").transpose(1, 0, 2)
        samples, hop = window.reshape(-1, length), length
    width = max(length // 2 + 1, basis.slow[0].width if basis.slow else 0)
    for place, rows in enumerate(_native.folded_frames(samples, length, hop, width)):
        part = rows.reshape(-1, width)
        _product(basis, place, part, parts[:, place].reshape(len(parts), len(part)))


def _product(basis: FoldedBasis, place: int, rows: Real, found: Real) -> None:
    """Slow sinusoids with the projected rows, fast ones with the rows themselves."""
    start, projected = len(found) - len(basis.cosine), rows
    for panels in reversed(basis.slow):
        projected = panels.space.project(projected)
        known = (panels.cosine, panels.sine)[place]
        start -= len(known)
        np.matmul(known, projected.T, out=found[start : start + len(known)])
    known = (basis.cosine, basis.sine)[place]
    fast = found[len(found) - len(known) :]
    np.matmul(known, rows[:, : known.shape[1]].T, out=fast)
