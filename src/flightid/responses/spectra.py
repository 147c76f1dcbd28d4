"""Averaged one-sided auto- and cross-spectra of all channels for one window length."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.windows.halving import Halves
from flightid.responses.windows.transform import (
    HANN_POWER,
    FoldedBasis,
    WindowPlan,
    runs,
    transform_of,
)

MAXIMUM_CHUNK = 1 << 22
"""Largest number of real values of transforms that are held at a time."""


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


def average_spectra(
    records: Sequence[NDArray[np.float64]] | Sequence[Halves],
    basis: FoldedBasis,
    sample_time_s: float,
) -> Spectra:
    """Average spectra over every window of every record; no window spans two records.

    Parameters
    ----------
    records : sequence of ndarray, each shape (n_channels, n_samples), or of Halves
        As `Halves` they are halved once for windows of all lengths.
    basis : FoldedBasis
        Tapered cosines and sines of the window length at the chosen frequencies.
    sample_time_s : float
    """
    plan, n_f = basis.plan, basis.n_frequencies
    known = [each if isinstance(each, Halves) else Halves(each) for each in records]
    channels = len(known[0].samples)
    equal = np.zeros((n_f, channels, channels))
    turned = np.zeros_like(equal)
    pieces = [(each, 0, plan.count(each.samples.shape[1])) for each in known]
    for group in runs(pieces, 2 * n_f * channels, MAXIMUM_CHUNK):
        parts = transform_of(group, basis)
        both = parts.reshape(n_f, -1, channels)
        equal += both.transpose(0, 2, 1) @ both
        turned += parts[:, 0].transpose(0, 2, 1) @ parts[:, 1]
    lengths = [each.samples.shape[1] for each in known]
    n_windows = sum(plan.count(n) for n in lengths)
    scale = 2.0 * sample_time_s / (HANN_POWER * plan.length * n_windows)
    matrix = equal + 1j * (turned - turned.transpose(0, 2, 1))
    return Spectra(
        plan,
        np.asarray(scale * matrix, dtype=np.complex128),
        n_windows,
        sum(plan.independent(n) for n in lengths),
    )
