"""Fourier transforms of overlapped Hann windows at arbitrary frequencies, as matrix products.

A Hann window is even about its middle, so each frame is folded there: its even part meets cosines
and its odd part sines, which halves the work of the matrix product. Every number is the exact
transform at the frequency that was asked for; no frequency is rounded to a grid of the window.

Slow frequencies do not need every sample: see `halving`. A mean that is removed from each window is
taken out of the basis instead, once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass
from flightid.responses.windows.halving import (
    Halves,
    exponentials,
    halved_rows,
    halved_weights,
    level_sizes,
    stepped_weights,
)

HANN_POWER = 3.0 / 8.0
"""Mean square of the (periodic) Hann window: what U is in the one-sided spectra."""
SMALL = 1e-9
"""Sine of half an angle below which a sum over a window is its length."""
ROWS_AT_ONCE = 1 << 19
"""Samples of frames that are folded at a time: their rows stay in the cache."""
Real = NDArray[np.float64]
Piece = tuple[Halves, int, int]
"""A record, the number of a first window, and how many."""


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
class LevelBasis:
    """Tapered cosines and sines of some frequencies on the rows of one level.

    Attributes
    ----------
    step : int
        Samples from one number of a row to the next.
    cosine, sine : ndarray, shape (n_f, width)
        Columns belong to distances 0, step, 2 · step … from the middle; half of the middle itself.
    """

    step: int
    cosine: Real
    sine: Real


@dataclass(frozen=True)
class FoldedBasis:
    """Tapered cosines and sines about the middle of a window, for one set of frequencies.

    Attributes
    ----------
    plan : WindowPlan
    detrend : {"none", "mean", "line"}
        What is removed from each window by itself.
    levels : tuple of LevelBasis
        The finest first, whose frequencies are the fastest; together they are all.
    """

    plan: WindowPlan
    detrend: str
    levels: tuple[LevelBasis, ...]

    @property
    def n_frequencies(self) -> int:
        """All frequencies."""
        return sum(len(each.cosine) for each in self.levels)

    @property
    def n_bytes(self) -> int:
        """Memory of its numbers."""
        return sum(each.cosine.nbytes + each.sine.nbytes for each in self.levels)

    @property
    def halved(self) -> bool:
        """Whether its finest rows are those of halved records."""
        return self.levels[0].step == 2

    @classmethod
    def of(cls, plan: WindowPlan, omega: Real, detrend: str = "none") -> FoldedBasis:
        """Basis for `omega` in rad per sample, increasing."""
        bend = 2.0 * np.pi / plan.length
        level = np.zeros(len(omega))
        if detrend == "mean":
            level = _taper_transform(plan, omega) / plan.length
        highest = omega + bend
        # Windows with a line of its own each are no record's.
        halved = detrend != "line" and halved_rows(highest, plan.length)
        sizes = level_sizes(highest, plan.length, halved=halved)
        slower = [*(slow for _, _, slow in sizes[1:]), 0]
        levels = []
        for (step, width, stop), start in zip(sizes, slower, strict=True):
            rest = exponentials(step * omega[start:stop], width)
            rest *= 0.5 + 0.5 * np.cos(step * bend * np.arange(width))
            cosine = rest.real - level[start:stop, None]
            cosine[:, 0] *= 0.5
            levels.append(LevelBasis(step, cosine, rest.imag.copy()))
        return cls(plan, detrend, tuple(levels))


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


def transform(samples: Real | Halves, basis: FoldedBasis) -> tuple[Real, Real]:
    """Transform of every window of every channel, time counted from the window's middle.

    Parameters
    ----------
    samples : ndarray, shape (n_channels, n_samples), or Halves
        As `Halves` for windows of several lengths.
    basis : FoldedBasis

    Returns
    -------
    tuple of ndarray, each shape (n_f, n_channels, n_windows)
        Real and imaginary parts of ``Σ w(t) x(t) exp(−jωt)``.
    """
    halves = samples if isinstance(samples, Halves) else Halves(samples)
    parts = transform_of([(halves, 0, basis.plan.count(halves.samples.shape[1]))], basis)
    real, imaginary = parts[:, 0].transpose(0, 2, 1), parts[:, 1].transpose(0, 2, 1)
    return real, imaginary


def transform_of(pieces: Sequence[Piece], basis: FoldedBasis) -> Real:
    """As `transform`, of windows of several records side by side.

    Parameters
    ----------
    pieces : sequence of (Halves, int, int)
        Records of as many channels each, the number of the first window and how many.
    basis : FoldedBasis

    Returns
    -------
    ndarray, shape (n_f, 2, n_windows, n_channels)
        Real and imaginary parts.
    """
    channels = len(pieces[0][0].samples)
    batches = list(runs(pieces, basis.plan.length * channels, ROWS_AT_ONCE))
    counts = [sum(count for _, _, count in batch) for batch in batches]
    parts = np.empty((basis.n_frequencies, 2, sum(counts), channels))
    # Fresh memory for each batch would take longer than the products.
    sizes = [max(counts, default=0) * channels * each.cosine.shape[1] for each in basis.levels]
    rows = [(np.empty(size), np.empty(size)) for size in sizes]
    first = 0
    for batch, count in zip(batches, counts, strict=True):
        _fill_rows(batch, basis, rows)
        start = basis.n_frequencies
        for sides, known in zip(rows, basis.levels, strict=True):
            start -= len(known.cosine)
            for place, (row, table) in enumerate(
                zip(sides, (known.cosine, known.sine), strict=True)
            ):
                found = parts[start : start + len(table), place, first : first + count]
                found = found.reshape(len(table), count * channels)
                many = row[: found.shape[1] * table.shape[1]].reshape(found.shape[1], -1)
                np.matmul(table, many.T, out=found)
        first += count
    return parts


def runs(pieces: Sequence[Piece], each: int, most: int) -> Iterator[list[Piece]]:
    """Pieces cut into runs of windows that are held together, so that memory stays bounded.

    Parameters
    ----------
    pieces : sequence of (Halves, int, int)
    each, most : int
        Numbers of one window, and of a run as far as it has more windows than one.
    """
    run: list[Piece] = []
    room = most
    for record, first, count in pieces:
        done = 0
        while done < count:
            if run and room < each:
                yield run
                run, room = [], most
            taken = min(count - done, max(room // each, 1))
            run.append((record, first + done, taken))
            done, room = done + taken, room - taken * each
    if run:
        yield run


def _fill_rows(pieces: Sequence[Piece], basis: FoldedBasis, rows: list[tuple[Real, Real]]) -> None:
    """Even and odd parts of windows about their middles, by level."""
    plan = basis.plan
    sizes = plan.length, plan.hop
    spans = [(first, count) for _, first, count in pieces]
    records = [halves.samples for halves, _, _ in pieces]
    if basis.detrend == "line":
        # Each has a line of its own: frames, one after another, as channels of one window.
        records = [
            frames(record, plan, "line").transpose(1, 0, 2)[first : first + count]
            for record, (first, count) in zip(records, spans, strict=True)
        ]
        records = [record.reshape(-1, plan.length) for record in records]
        spans, sizes = [(0, 1)] * len(records), (plan.length, plan.length)
    weights, halves = np.empty(0), []
    if basis.halved:
        weights = halved_weights()
        halves = [each.about(plan.length // 2, plan.hop) for each, _, _ in pieces]
    _native.folded_frames(records, halves, spans, sizes, weights, stepped_weights(), rows)
