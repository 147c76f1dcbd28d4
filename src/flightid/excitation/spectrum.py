"""Spectra of designed inputs: density, smoothing, coverage of a band, coherence between inputs.

Conventions: one-sided power spectral density in unit²/Hz of the record as it stands (no taper), so
that its sum times the bin width is the mean square. Smoothed values are means of power over a band
of constant relative width, since single lines of a multisine or of noise say nothing on coverage.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

RELATIVE_HALF_WIDTH = 0.12
"""Half-width of the smoothing band over its centre: a third of an octave in all."""
MINIMUM_HALF_WIDTH_BINS = 2.0
"""Least half-width, in bins for each input: harmonics are dealt to the inputs in turn."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectral densities of the inputs.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_freqs,)
        Frequencies, rad/s.
    density : ndarray, shape (n_inputs, n_freqs)
        Power spectral density, unit²/Hz.
    names : tuple of str
        Inputs.
    unit : str
        Unit of the inputs.

    Example
    -------
    >>> import numpy as np
    >>> spectrum = power_spectrum(np.ones((1, 8)), 0.1, ("u",), "1")
    >>> spectrum.mean_square()
    array([1.])
    """

    omega_rad_s: NDArray[np.float64]
    density: NDArray[np.float64]
    names: tuple[str, ...]
    unit: str

    def mean_square(self) -> NDArray[np.float64]:
        """Mean square of each input, unit², shape (n_inputs,); holds for evenly spaced bins."""
        spacing_hz = (self.omega_rad_s[1] - self.omega_rad_s[0]) / (2 * np.pi)
        return np.asarray(np.sum(self.density, axis=1) * spacing_hz)


def power_spectrum(
    signals: NDArray[np.float64], sample_time_s: float, names: tuple[str, ...], unit: str
) -> Spectrum:
    """One-sided periodogram of each input at the bins of its discrete Fourier transform."""
    n_samples = signals.shape[1]
    transform = np.fft.rfft(signals, axis=1)
    density = _one_sided(n_samples) * (sample_time_s / n_samples) * np.abs(transform) ** 2
    omega = np.asarray(2 * np.pi * np.fft.rfftfreq(n_samples, sample_time_s), dtype=np.float64)
    return Spectrum(omega, density, names, unit)


def smoothed_matrix(
    signals: NDArray[np.float64], sample_time_s: float, omega_rad_s: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Smoothed auto- and cross-spectra, unit²/Hz, shape (n_inputs, n_inputs, n_freqs)."""
    n_inputs, n_samples = signals.shape
    transform = np.fft.rfft(signals, axis=1)
    scale = _one_sided(n_samples) * sample_time_s / n_samples
    spacing = 2 * np.pi / (n_samples * sample_time_s)
    edges = spacing * (np.arange(transform.shape[1] + 1) - 0.5)
    least = MINIMUM_HALF_WIDTH_BINS * n_inputs * spacing
    half = np.maximum(RELATIVE_HALF_WIDTH * omega_rad_s, least)
    low = np.clip(omega_rad_s - half, edges[0], edges[-1])
    high = np.clip(omega_rad_s + half, edges[0], edges[-1])
    matrix = np.empty((n_inputs, n_inputs, omega_rad_s.size), dtype=np.complex128)
    for i in range(n_inputs):
        for j in range(n_inputs):
            density = scale * np.conj(transform[i]) * transform[j]
            total = np.concatenate(([0.0], np.cumsum(density))) * spacing
            matrix[i, j] = (np.interp(high, edges, total) - np.interp(low, edges, total)) / (
                high - low
            )
    return matrix


def coherence_between(matrix: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Ordinary coherence of each pair of inputs, shape (n_inputs, n_inputs, n_freqs).

    Where an input has no power its coherence with the others is zero.
    """
    auto = np.real(np.einsum("iik->ik", matrix))
    scale = auto[:, None, :] * auto[None, :, :]
    coherence = np.zeros(matrix.shape)
    np.divide(np.abs(matrix) ** 2, scale, out=coherence, where=scale > 0)
    return coherence


def _one_sided(n_samples: int) -> NDArray[np.float64]:
    factor = np.full(n_samples // 2 + 1, 2.0)
    factor[0] = 1.0
    if n_samples % 2 == 0:
        factor[-1] = 1.0
    return factor
