"""Covariance of windowed estimates across frequencies and inputs.

Every estimate of this stage is, to first order, linear in the output noise v: an error is
``δH(ω) = Σ_t g(t; ω) v(t)``, with g known from the inputs, the windows and the conditioning. The
covariance is then the Gram matrix of the g under the noise spectrum. It holds for overlapped
windows, for neighbouring frequencies inside one window's bandwidth, and for sweeps, whose power
passes a frequency once: none of which coherence and a count of windows can know.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from flightid.responses.noise import NoiseSpectrum
from flightid.responses.transform import FoldedBasis, WindowPlan, transform

COLUMNS = 4096
"""Frequencies of the noise that are worked on at a time: bounds memory."""
Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class WindowShare:
    """What one window length adds to the errors.

    Attributes
    ----------
    plan : WindowPlan
    projection : ndarray of complex, shape (n_f, n_in, n_instruments)
        Takes a window's conjugate instrument transforms to the weight of its output transform.
    """

    plan: WindowPlan
    projection: Complex


@dataclass(frozen=True)
class WindowedErrors:
    """Errors of a composite (or single-window) estimate; the covariance is made when asked for.

    Attributes
    ----------
    instruments : tuple of ndarray, each shape (n_instruments, n_samples)
        Inputs, or excitations of a closed loop, of each record.
    omega : ndarray, shape (n_f,)
        Frequencies, rad per sample.
    sample_time_s : float
    detrend : str
    shares : tuple of WindowShare
    sensitivity : ndarray, shape (n_windows, 2, 2, n_out, n_in, n_f)
        From real and imaginary part of a window's response to those of the estimate.
    noise : NoiseSpectrum
    """

    instruments: tuple[Real, ...]
    omega: Real
    sample_time_s: float
    detrend: str
    shares: tuple[WindowShare, ...]
    sensitivity: Real
    noise: NoiseSpectrum

    def covariance(
        self, outputs: NDArray[np.intp], inputs: NDArray[np.intp], frequencies: NDArray[np.intp]
    ) -> Real:
        """See `CovarianceSource`."""
        size = 2 * len(inputs) * len(frequencies)
        total = np.zeros((len(outputs), size, size))
        sensitivity = self.sensitivity[:, :, :, outputs][:, :, :, :, inputs][..., frequencies]
        longest = max(share.plan.length for share in self.shares)
        for record in self.instruments:
            length = next_fast_len(record.shape[1] + longest // 2, real=True)
            weights = [self._weights(record, k, inputs, frequencies) for k in self.shares]
            bins = np.arange(length // 2 + 1)
            for columns in np.array_split(bins, -(-len(bins) // COLUMNS)):
                self._add(total, columns, length, weights, sensitivity, outputs, frequencies)
        return total

    def _weights(
        self,
        record: Real,
        share: WindowShare,
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> Complex:
        """Weight of each window's output transform, shape (n_in, n_f, n_windows)."""
        basis = FoldedBasis.of(share.plan, self.omega[frequencies])
        real, imaginary = transform(record, basis, self.detrend)
        projection = share.projection[frequencies][:, inputs]
        return np.asarray((projection @ (real - 1j * imaginary)).transpose(1, 0, 2))

    def _add(
        self,
        total: Real,
        columns: NDArray[np.intp],
        length: int,
        weights: Sequence[Complex],
        sensitivity: Real,
        outputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> None:
        angle = 2.0 * np.pi * columns / length
        density = self.noise.at(angle / self.sample_time_s) / (2.0 * self.sample_time_s)
        twice = np.where((columns == 0) | (2 * columns == length), 1.0, 2.0) / length
        parts = []
        for share, weight in zip(self.shares, weights, strict=True):
            ahead = _kernel(share.plan, weight, self.omega[frequencies], angle, self.detrend)
            behind = _kernel(share.plan, weight, self.omega[frequencies], -angle, self.detrend)
            mirrored = behind.conj()
            parts.append(((ahead + mirrored) / 2.0, (ahead - mirrored) / 2.0j))
        for place, output in enumerate(outputs):
            rows = np.concatenate(
                [
                    sum(
                        turn[part, 0, place][:, :, None] * real
                        + turn[part, 1, place][:, :, None] * imaginary
                        for turn, (real, imaginary) in zip(sensitivity, parts, strict=True)
                    ).reshape(-1, len(columns))
                    for part in (0, 1)
                ]
            )
            rows *= np.sqrt(twice * density[output])
            flat = np.concatenate([rows.real, rows.imag], axis=1)
            total[place] += flat @ flat.T


def _kernel(plan: WindowPlan, weight: Complex, omega: Real, angle: Real, detrend: str) -> Complex:
    """Fourier transform of g, shape (n_in, n_f, n_angles).

    Windows are copies of one basis function at their own places, so the transform is that of the
    places times that of the function.
    """
    middles = plan.length // 2 + plan.hop * np.arange(weight.shape[2])
    return np.asarray(
        (weight @ np.exp(-1j * np.multiply.outer(middles, angle)))
        * basis_transform(plan.length, omega, angle, detrend)
    )


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
    found = _hann(length, np.add.outer(omega, angle))
    if detrend == "none":
        return found
    flat = _dirichlet(length, angle)
    found = found - np.multiply.outer(_hann(length, omega) / length, flat)
    if detrend == "line":
        norm = length * (length**2 - 1.0) / 12.0
        found = found - np.multiply.outer(_hann_slope(length, omega) / norm, _slope(length, angle))
    return found


def _dirichlet(length: int, x: Real) -> Complex:
    """``Σ exp(−jxm)`` over m = −length/2 … length/2 − 1."""
    half = np.sin(x / 2.0)
    small = np.abs(half) < 1e-12
    ratio = np.sin(length * x / 2.0) / np.where(small, 1.0, half)
    return np.asarray(np.exp(0.5j * x) * np.where(small, length, ratio))


def _hann(length: int, x: Real) -> Complex:
    step = 2.0 * np.pi / length
    sides = _dirichlet(length, x - step) + _dirichlet(length, x + step)
    return 0.5 * _dirichlet(length, x) + 0.25 * sides


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
