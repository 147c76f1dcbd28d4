"""Covariance of windowed estimates across frequencies and inputs.

Every estimate of this stage is, to first order, linear in the output noise v: an error is
``δH(ω) = Σ_t g(t; ω) v(t)``, with g known from the inputs, the windows and the conditioning. The
covariance is then the Gram matrix of the g under the noise spectrum. It holds for overlapped
windows, for neighbouring frequencies inside one window's bandwidth, and for sweeps, whose power
passes a frequency once: none of which coherence and a count of windows can know. The g do not know
the output, so the cross-spectra of the noise give the covariance between outputs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.errors.noise import NoiseOfRecords, NoiseSpectrum
from flightid.responses.errors.noise_kernels import (
    kept_transforms,
    kept_turns,
    mirrored_kernels,
)
from flightid.responses.errors.noise_levels import LevelProducts, LevelVariances
from flightid.responses.errors.random_error import JointErrors, Points, union
from flightid.responses.windows.kept_bases import kept
from flightid.responses.windows.window_weights import WindowWeights

COLUMNS = 128
"""Frequencies of the noise that are worked on at a time: bounds memory, and suits caches."""
SIDE_LOBES = 40.0
"""Bins of the shortest window beyond the highest frequency, past which noise does not reach the
estimate: a Hann window's side lobes are down by 1e-9 in power there."""
Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Places = NDArray[np.intp]
_Mine = tuple[Places, Complex]
"""Frequencies that some kernels reach, and the kernels there."""


class SensitiveComposite(Protocol):
    """A composite of window lengths."""

    @property
    def sensitivity(self) -> Real:
        """From parts of each window's response to the estimate's: see `Composite`."""


@dataclass(frozen=True)
class WindowedErrors(JointErrors):
    """Errors of a composite (or single-window) estimate; the covariance is made when asked for.

    Attributes
    ----------
    windows : WindowWeights
    sample_time_s : float
    composite : SensitiveComposite
    known_noise : NoiseSpectrum or NoiseOfRecords
    """

    windows: WindowWeights
    sample_time_s: float
    composite: SensitiveComposite
    known_noise: NoiseSpectrum | NoiseOfRecords

    @property
    def noise(self) -> NoiseSpectrum:
        """Noise spectra of the outputs."""
        known = self.known_noise
        return known if isinstance(known, NoiseSpectrum) else known.spectrum

    def covariances(self, wanted: Sequence[Points]) -> list[Real]:
        """See `JointErrors`: the kernels of the noise do not depend on the output."""
        inputs, frequencies = union(wanted)
        parts = [self._part(each, inputs, frequencies) for each in wanted]
        totals = [np.zeros(2 * (2 * len(each.inputs) * len(each.frequencies),)) for each in wanted]
        points = [(each.inputs.tobytes(), each.frequencies.tobytes()) for each in wanted]
        for noise, kernels, near in self._kernels(inputs, frequencies):
            # Outputs at the same points share their kernels.
            mine: dict[tuple[bytes, bytes], _Mine] = {}
            for part, place, total in zip(parts, points, totals, strict=True):
                if place not in mine:
                    mine[place] = part.reached(kernels, near)
                part.add(mine[place], noise.level[part.output], total)
        return totals

    def combined(self, wanted: Sequence[Points], gains: Sequence[Real]) -> Real:
        """See `JointErrors`."""
        return self.combined_by_level(wanted, gains, 0)[0]

    def combined_by_level(
        self, wanted: Sequence[Points], gains: Sequence[Real], count: int
    ) -> tuple[Real, list[LevelVariances]]:
        """See `LevelledErrors`: each bin has its share in the levels of its output's noise."""
        inputs, frequencies = union(wanted)
        parts = [
            self._part(each, inputs, frequencies).through(gain)
            for each, gain in zip(wanted, gains, strict=True)
        ]
        total = np.zeros(2 * (len(gains[0]),))
        levels = [self.noise.levels_of(part.output) for part in parts] if count else []
        told = [np.zeros((0 if each is None else len(each.freedom), count)) for each in levels]
        for noise, kernels, near in self._kernels(inputs, frequencies):
            moved = [part.combine(kernels, near) * noise.level[part.output] for part in parts]
            for place, (part, row) in enumerate(zip(parts, moved, strict=True)):
                for other, column in zip(parts[: place + 1], moved[: place + 1], strict=True):
                    turn = noise.coherency[:, part.output, other.output]
                    block = np.real((row * turn) @ column.conj().T)
                    total += block if part is other else block + block.T
            for each, row, variances in zip(levels, moved, told, strict=False):
                if each is not None:
                    variances[:] += each.shares(noise.omega_rad_s) @ (np.abs(row[:count]) ** 2).T
        pairs = zip(levels, told, strict=True)
        return total, [LevelVariances(v, each.freedom) for each, v in pairs if each is not None]

    def by_level(
        self, wanted: Sequence[Points], gains: Sequence[Real]
    ) -> list[LevelProducts | None]:
        """See `LevelledErrors`."""
        inputs, frequencies = union(wanted)
        parts = [self._part(each, inputs, frequencies) for each in wanted]
        levels = [self.noise.levels_of(part.output) for part in parts]
        found = [
            np.zeros((0 if each is None else len(each.freedom), gain.shape[1], len(gain)))
            for each, gain in zip(levels, gains, strict=True)
        ]
        # Gains without rows ask whether levels are known: no kernel is needed for that.
        asked = any(map(len, gains))
        for noise, kernels, near in self._kernels(inputs, frequencies) if asked else ():
            for part, gain, each, products in zip(parts, gains, levels, found, strict=True):
                if each is None:
                    continue
                mine = part.reached(kernels, near)
                rows, points = part.weighted(mine, noise.level[part.output])
                turned = (gain[:, points] @ rows).conj()
                shares = each.shares(noise.omega_rad_s)
                for level in np.flatnonzero(np.any(shares > 0.0, axis=1)):
                    bins = np.flatnonzero(shares[level])
                    some = (rows[:, bins] * shares[level, bins]) @ turned[:, bins].T
                    products[level, points] += np.real(some)
        return [
            None if each is None else LevelProducts(products, each.freedom)
            for each, products in zip(levels, found, strict=True)
        ]

    def _kernels(
        self, inputs: Places, frequencies: Places
    ) -> Iterator[tuple[_BinNoise, Complex, Places]]:
        """Kernels of all records, some bins of the noise at a time, with the noise there."""
        chosen = self.windows.weights_at(inputs, frequencies)
        lengths = [record.shape[1] for record in self.windows.instruments]
        for n_samples in sorted(set(lengths)):
            weights = [each for each, n in zip(chosen, lengths, strict=True) if n == n_samples]
            length, bins = self._noise_bins(n_samples, frequencies)
            asked = "kernels", n_samples, inputs.tobytes(), frequencies.tobytes()
            for columns in np.array_split(bins, -(-len(bins) // COLUMNS)):
                yield from self._of_bins(columns, length, weights, frequencies, asked)

    def _part(self, wanted: Points, inputs: Places, frequencies: Places) -> _Part:
        turns = self.composite.sensitivity[:, :, :, wanted.output][:, :, :, wanted.inputs]
        return _Part(
            wanted.output,
            np.searchsorted(inputs, wanted.inputs),
            np.searchsorted(frequencies, wanted.frequencies),
            _mixing(turns[..., wanted.frequencies]),
        )

    def _noise_bins(
        self, n_samples: int, frequencies: NDArray[np.intp]
    ) -> tuple[int, NDArray[np.intp]]:
        """Length of the noise's Fourier transform, and its bins that reach the estimate."""
        longest = max(share.plan.length for share in self.windows.shares)
        length = int(scipy.fft.next_fast_len(n_samples + longest // 2, real=True))
        highest = float(self.windows.omega[frequencies].max()) + self._reach()
        last = min(length // 2, int(highest * length / (2.0 * np.pi)) + 1)
        return length, np.arange(last + 1)

    def _reach(self) -> float:
        """How far above a frequency noise reaches its estimate, rad per sample."""
        return SIDE_LOBES * 2.0 * np.pi / min(share.plan.length for share in self.windows.shares)

    def _of_bins(
        self,
        columns: Places,
        length: int,
        records: Sequence[Sequence[Complex]],
        frequencies: Places,
        asked: tuple[Any, ...],
    ) -> Iterator[tuple[_BinNoise, Complex, Places]]:
        """Noise and kernels at some bins, for all records of one length; `asked` names both."""
        angle = 2.0 * np.pi * columns / length
        noise = self._noise_at(columns, length)
        omega = self.windows.omega[frequencies]
        near = np.flatnonzero(omega + self._reach() >= angle[0])
        for place, weights in enumerate(records):
            # Errors are asked for again with another noise, of which kernels know nothing. The key
            # is of the windows, which live as long as what is kept for them.
            _, kernels = kept(
                partial(tuple, (*asked, id(self.windows), int(columns[0]), place)),
                partial(self._kernel, weights, near, omega[near], angle),
                lambda made: made[1].nbytes,
                shelf="kernels",
            )
            yield noise, kernels, near

    def _kernel(
        self, weights: Sequence[Complex], near: Places, omega: Real, angle: Real
    ) -> tuple[WindowWeights, Complex]:
        """Kernels of one record, (n_in, n_near, 2 · n_windows, n_bins), and whose they are."""
        shares, detrend = self.windows.shares, self.windows.detrend
        shape = (len(weights[0]), len(omega), 2 * len(shares), len(angle))
        kernels = np.empty(shape, dtype=np.complex128)
        for place, (share, weight) in enumerate(zip(shares, weights, strict=True)):
            plan = share.plan
            both = kept_transforms(plan.length, omega.tobytes(), angle.tobytes(), detrend)
            turn = kept_turns(plan.length // 2, plan.hop, weight.shape[2], angle.tobytes())
            into = kernels[:, :, 2 * place : 2 * place + 2]
            mirrored_kernels(weight[:, near], turn, both, into)
        kernels.setflags(write=False)
        return self.windows, kernels

    def _noise_at(self, columns: Places, length: int) -> _BinNoise:
        omega: Real = np.asarray(2.0 * np.pi * columns / (length * self.sample_time_s))
        density = self.noise.at(omega) / (2.0 * self.sample_time_s)
        twice = np.where((columns == 0) | (2 * columns == length), 1.0, 2.0) / length
        return _BinNoise(omega, np.sqrt(twice * density), self.noise.coherency_at(omega))


@dataclass(frozen=True)
class _BinNoise:
    """Noise at some bins.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_bins,)
    level : ndarray, shape (n_out, n_bins)
        Root of the noise power at each bin.
    coherency : ndarray of complex, shape (n_bins, n_out, n_out)
        Conjugate on the first index.
    """

    omega_rad_s: Real
    level: Real
    coherency: Complex


@dataclass(frozen=True)
class _Part:
    """Errors of one output at chosen points, as combinations of the kernels.

    Attributes
    ----------
    output : int
    inputs, frequencies : ndarray of int
        Places among those that the kernels are made for.
    mixing : ndarray, shape (n_in, n_f, n_rows, 2 · n_windows)
        Weights of the windows' kernels at each point: for its real and imaginary part, or for
        each row of a gain.
    """

    output: int
    inputs: Places
    frequencies: Places
    mixing: Real

    def through(self, gain: Real) -> _Part:
        """The same errors after a gain, shape (n_rows, 2 n_in n_f)."""
        n_in, n_f = self.mixing.shape[:2]
        split = gain.reshape(len(gain), 2, n_in, n_f)
        return replace(self, mixing=np.einsum("paif,ifak->ifpk", split, self.mixing))

    def combine(self, kernels: Complex, near: Places) -> Complex:
        """Sum of the mixed kernels over all points, shape (n_rows, n_bins).

        Parameters
        ----------
        kernels : ndarray of complex, shape (all inputs, n_near, 2 · n_windows, n_bins)
            Of real and imaginary part for each window length.
        near : ndarray of int
            Frequencies, among all, that the kernels are for.
        """
        here, mine = self.reached(kernels, near)
        rows = self.mixing[:, here].transpose(2, 0, 1, 3).reshape(self.mixing.shape[2], -1)
        flat = mine.view(np.float64).reshape(rows.shape[1], 2 * kernels.shape[-1])
        return np.asarray((rows @ flat).view(np.complex128))

    def add(self, mine: _Mine, level: Real, total: Real) -> None:
        """Add the Gram matrix of the weighted kernels of all points to `total`."""
        rows, places = self.weighted(mine, level)
        flat = rows.view(np.float64)
        if len(places) == len(total):  # most bins of noise reach all points
            total += flat @ flat.T
        else:
            total[places[:, None], places] += flat @ flat.T

    def weighted(self, mine: _Mine, level: Real) -> tuple[Complex, Places]:
        """Kernels of all points at the noise's level, (n, n_bins), and the places of these rows."""
        here, kernels = mine
        mixed = self.mixing[:, here] @ kernels.view(np.float64)
        both = np.repeat(level, 2)
        flat = (mixed.transpose(2, 0, 1, 3) * both).reshape(-1, len(both))
        places = np.add.outer(np.arange(2 * len(self.inputs)) * len(self.frequencies), here).ravel()
        return flat.view(np.complex128), places

    def reached(self, kernels: Complex, near: Places) -> _Mine:
        """Which of the frequencies the kernels reach, and the kernels there."""
        first = near[0] if len(near) else np.inf  # all frequencies from one on
        here = np.flatnonzero(self.frequencies >= first)
        columns = self.frequencies[here] - int(first) if len(here) else here
        return here, kernels[self.inputs[:, None], columns]


def _mixing(sensitivity: Real) -> Real:
    """Sensitivities (n_windows, 2, 2, n_in, n_f) as one matrix for each input and frequency."""
    windows, _, _, inputs, count = sensitivity.shape
    ordered = sensitivity.transpose(3, 4, 1, 0, 2)
    return np.ascontiguousarray(ordered).reshape(inputs, count, 2, 2 * windows)
