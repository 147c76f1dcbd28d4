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
from flightid.responses.uncertainty import Points

COLUMNS = 128
"""Frequencies of the noise that are worked on at a time: bounds memory, and suits caches."""
SIDE_LOBES = 40.0
"""Bins of the shortest window beyond the highest frequency, past which noise does not reach the
estimate: a Hann window's side lobes are down by 1e-9 in power there."""
Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Places = NDArray[np.intp]


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
        return np.stack(
            self.covariances([Points(int(output), inputs, frequencies) for output in outputs])
        )

    def covariances(self, wanted: Sequence[Points]) -> list[Real]:
        """See `SharedWork`: the kernels of the noise do not depend on the output."""
        inputs = np.unique(np.concatenate([each.inputs for each in wanted]))
        frequencies = np.unique(np.concatenate([each.frequencies for each in wanted]))
        parts = [self._part(each, inputs, frequencies) for each in wanted]
        for n_samples in sorted({record.shape[1] for record in self.instruments}):
            weights = [
                [self.weights(record, share, inputs, frequencies) for share in self.shares]
                for record in self.instruments
                if record.shape[1] == n_samples
            ]
            length, bins = self._noise_bins(n_samples, frequencies)
            for columns in np.array_split(bins, -(-len(bins) // COLUMNS)):
                self._add(parts, columns, length, weights, frequencies)
        return [part.total for part in parts]

    def _part(self, wanted: Points, inputs: Places, frequencies: Places) -> _Part:
        turns = self.sensitivity[:, :, :, wanted.output][:, :, :, wanted.inputs]
        size = 2 * len(wanted.inputs) * len(wanted.frequencies)
        return _Part(
            wanted.output,
            np.searchsorted(inputs, wanted.inputs),
            np.searchsorted(frequencies, wanted.frequencies),
            _mixing(turns[..., wanted.frequencies]),
            np.zeros((size, size)),
        )

    def _noise_bins(
        self, n_samples: int, frequencies: NDArray[np.intp]
    ) -> tuple[int, NDArray[np.intp]]:
        """Length of the noise's Fourier transform, and its bins that reach the estimate."""
        longest = max(share.plan.length for share in self.shares)
        length = int(next_fast_len(n_samples + longest // 2, real=True))
        highest = float(self.omega[frequencies].max()) + self._reach()
        last = min(length // 2, int(highest * length / (2.0 * np.pi)) + 1)
        return length, np.arange(last + 1)

    def _reach(self) -> float:
        """How far above a frequency noise reaches its estimate, rad per sample."""
        return SIDE_LOBES * 2.0 * np.pi / min(share.plan.length for share in self.shares)

    def weights(
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
        parts: Sequence[_Part],
        columns: NDArray[np.intp],
        length: int,
        records: Sequence[Sequence[Complex]],
        frequencies: Places,
    ) -> None:
        """Add what some bins of the noise contribute, for all records of one length."""
        angle = 2.0 * np.pi * columns / length
        density = self.noise.at(angle / self.sample_time_s) / (2.0 * self.sample_time_s)
        twice = np.where((columns == 0) | (2 * columns == length), 1.0, 2.0) / length
        level = np.repeat(np.sqrt(twice * density), 2, axis=1)
        omega = self.omega[frequencies]
        near = np.flatnonzero(omega + self._reach() >= angle[0])
        bases = [
            tuple(
                basis_transform(share.plan.length, omega[near], sign * angle, self.detrend)
                for sign in (1.0, -1.0)
            )
            for share in self.shares
        ]
        turns = [_turns(*one, angle) for one in zip(self.shares, records[0], strict=True)]
        for weights in records:
            kernels = []
            for weight, turn, (above, below) in zip(weights, turns, bases, strict=True):
                ahead = (weight[:, near] @ turn) * above
                mirrored = ((weight[:, near] @ turn.conj()) * below).conj()
                kernels += [(ahead + mirrored) / 2.0, (ahead - mirrored) / 2.0j]
            stacked = np.stack(kernels, axis=2)
            for part in parts:
                part.add(stacked, near, level[part.output])


@dataclass(frozen=True)
class _Part:
    """The covariance of one output in the making.

    Attributes
    ----------
    output : int
    inputs, frequencies : ndarray of int
        Places among those that the kernels are made for.
    mixing : ndarray, shape (n_in, n_f, 2, 2 · n_windows)
        Sensitivities of real and imaginary part of the estimate to those of the windows' responses.
    total : ndarray, shape (2 n_in n_f, 2 n_in n_f)
        Added to.
    """

    output: int
    inputs: Places
    frequencies: Places
    mixing: Real
    total: Real

    def add(self, kernels: Complex, near: Places, level: Real) -> None:
        """Add the Gram matrix of the weighted kernels.

        Parameters
        ----------
        kernels : ndarray of complex, shape (all inputs, n_near, 2 · n_windows, n_bins)
            Of real and imaginary part for each window length.
        near : ndarray of int
            Frequencies, among all, that the kernels are for.
        level : ndarray, shape (2 · n_bins,)
            Root of the noise power at each bin, for real and imaginary part.
        """
        here = np.flatnonzero(np.isin(self.frequencies, near))
        if not here.size:
            return
        columns = np.searchsorted(near, self.frequencies[here])
        mine = kernels[self.inputs[:, None], columns]
        mixed = self.mixing[:, here] @ mine.view(np.float64)
        flat = (mixed.transpose(2, 0, 1, 3) * level).reshape(-1, len(level))
        places = np.add.outer(np.arange(2 * len(self.inputs)) * len(self.frequencies), here).ravel()
        self.total[places[:, None], places] += flat @ flat.T


def _mixing(sensitivity: Real) -> Real:
    """Sensitivities (n_windows, 2, 2, n_in, n_f) as one matrix for each input and frequency."""
    windows, _, _, inputs, count = sensitivity.shape
    ordered = sensitivity.transpose(3, 4, 1, 0, 2)
    return np.ascontiguousarray(ordered).reshape(inputs, count, 2, 2 * windows)


def _turns(share: WindowShare, weight: Complex, angle: Real) -> Complex:
    """Transform of unit samples at the windows' middles, shape (n_windows, n_angles).

    Windows are copies of one basis function, so the transform of g is that of the windows' weights
    at their places times the function's.
    """
    middles = share.plan.length // 2 + share.plan.hop * np.arange(weight.shape[2])
    return np.asarray(np.exp(-1j * np.multiply.outer(middles, angle)))


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
