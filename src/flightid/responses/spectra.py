"""Averaged one-sided auto- and cross-spectra of all channels for one window length."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.windows.transform import HANN_POWER, FoldedBasis, WindowPlan, transform_into

MAXIMUM_CHUNK = 1 << 22
"""Largest number of real values of frames, or of their transforms, that are held at a time."""


@dataclass(frozen=True)
class Spectra:
    """Spectral matrix of all channels, averaged over the windows of all records.

    Attributes
    ----------
    plan : WindowPlan
    matrix : ndarray of complex, shape (n_f, n_channels, n_channels)
        ``G[f, a, b]``: one-sided cross-spectrum of channels a and b, conjugate on a, per Hz.
    n_windows : int
        Windows averaged.
    n_independent : float
        Windows without overlap that would cover the same samples: what random error depends on.
    """

    plan: WindowPlan
    matrix: NDArray[np.complex128]
    n_windows: int
    n_independent: float


def pieces(
    samples: NDArray[np.float64], plan: WindowPlan, n_f: int
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Cut a record into runs of whole windows, none twice, so that memory stays bounded.

    Yields
    ------
    tuple of int and ndarray
        Number of the first window of the piece, and its samples.
    """
    count = plan.count(samples.shape[1])
    # Windows overlap, so that the frames of a piece are longer than its samples.
    step = max(1, MAXIMUM_CHUNK // (max(2 * n_f, plan.length) * samples.shape[0]))
    for first in range(0, count, step):
        last = min(first + step, count)
        start = first * plan.hop
        yield first, samples[:, start : start + (last - first - 1) * plan.hop + plan.length]


def _groups(
    records: Sequence[NDArray[np.float64]], plan: WindowPlan, n_f: int
) -> Iterator[list[NDArray[np.float64]]]:
    """Pieces of records whose transforms are held together."""
    group: list[NDArray[np.float64]] = []
    held = 0
    for samples in records:
        for _, piece in pieces(samples, plan, n_f):
            more = 2 * n_f * plan.count(piece.shape[1]) * piece.shape[0]
            if group and held + more > MAXIMUM_CHUNK:
                yield group
                group, held = [], 0
            group.append(piece)
            held += more
    if group:
        yield group


def average_spectra(
    records: Sequence[NDArray[np.float64]],
    basis: FoldedBasis,
    sample_time_s: float,
) -> Spectra:
    """Average spectra over every window of every record; no window spans two records.

    Parameters
    ----------
    records : sequence of ndarray, each shape (n_channels, n_samples)
    basis : FoldedBasis
        Tapered cosines and sines of the window length at the chosen frequencies.
    sample_time_s : float
    """
    plan, n_f = basis.plan, basis.n_frequencies
    channels = records[0].shape[0]
    equal = np.zeros((n_f, channels, channels))
    turned = np.zeros_like(equal)
    for group in _groups(records, plan, n_f):
        parts = np.empty((n_f, 2, sum(plan.count(each.shape[1]) for each in group), channels))
        start = 0
        for samples in group:
            stop = start + plan.count(samples.shape[1])
            transform_into(samples, basis, parts[:, :, start:stop])
            start = stop
        both = parts.reshape(n_f, -1, channels)
        equal += both.transpose(0, 2, 1) @ both
        turned += parts[:, 0].transpose(0, 2, 1) @ parts[:, 1]
    n_windows = sum(plan.count(samples.shape[1]) for samples in records)
    scale = 2.0 * sample_time_s / (HANN_POWER * plan.length * n_windows)
    matrix = equal + 1j * (turned - turned.transpose(0, 2, 1))
    return Spectra(
        plan,
        np.asarray(scale * matrix, dtype=np.complex128),
        n_windows,
        sum(plan.independent(samples.shape[1]) for samples in records),
    )
