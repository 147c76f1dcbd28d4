"""Covariance of local polynomial estimates: what the bins of two fits share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.errors.noise import NoiseSpectrum
from flightid.responses.errors.noise_levels import LevelProducts, LevelVariances
from flightid.responses.errors.random_error import JointErrors, Points, union
from flightid.responses.windows.local_fit import LocalFit


@dataclass(frozen=True)
class LocalErrors(JointErrors):
    """Errors of local polynomial estimates: two frequencies share the bins that both fits use.

    Bins of noise are circular, so there is no pseudo-covariance.

    Attributes
    ----------
    fits : tuple of LocalFit
    noise : NoiseSpectrum
        At the estimate's frequencies.
    """

    fits: tuple[LocalFit, ...]
    noise: NoiseSpectrum

    def covariances(self, wanted: Sequence[Points]) -> list[NDArray[np.float64]]:
        """See `JointErrors`: shares of bins do not depend on the output."""
        overlap = self._overlaps(*union(wanted))
        return [self._block(overlap, wanted, each, each) for each in wanted]

    def combined(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """See `JointErrors`."""
        return self.combined_by_level(wanted, gains, 0)[0]

    def combined_by_level(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]], count: int
    ) -> tuple[NDArray[np.float64], list[LevelVariances]]:
        """See `LevelledErrors`: each frequency has a level of its own, what its fit leaves."""
        overlap = self._overlaps(*union(wanted))
        total = np.zeros(2 * (len(gains[0]),))
        told = []
        for place, (one, left) in enumerate(zip(wanted, gains, strict=True)):
            for other, right in zip(wanted[: place + 1], gains[: place + 1], strict=True):
                moved = self._block(overlap, wanted, one, other) @ right.T
                block = left @ moved
                total += block if one is other else block + block.T
                if one is other and count:
                    each = (left[:count].T * moved[:, :count]).reshape(_parts(one))
                    told.append(LevelVariances(each.sum(axis=(0, 1)), self._freedom(one)))
        return total, told

    def by_level(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]]
    ) -> list[LevelProducts | None]:
        """See `LevelledErrors`: two points share the root of both levels, so each half of it."""
        overlap = self._overlaps(*union(wanted))
        found: list[LevelProducts | None] = []
        for one, gain in zip(wanted, gains, strict=True):
            block = self._block(overlap, wanted, one, one)
            moved, n_f = block @ gain.T, len(one.frequencies)
            level = np.arange(len(block)) % n_f
            products = np.zeros((n_f, *moved.shape))
            for each in range(n_f):
                mine = np.flatnonzero(level == each)
                products[each] = 0.5 * block[:, mine] @ gain[:, mine].T
                products[each, mine] += 0.5 * moved[mine]
            found.append(LevelProducts(products, self._freedom(one)))
        return found

    def _freedom(self, wanted: Points) -> NDArray[np.float64]:
        """Degrees of freedom of each frequency's level, as if levels were independent.

        Fits that share bins share what is left of them: a level counts by what it has alone.
        """
        fits = [self.fits[frequency] for frequency in wanted.frequencies]
        shared = np.array([[_shared_bins(one, other) for other in fits] for one in fits])
        alike = shared.sum(axis=1) / np.diag(shared)
        return np.asarray(2.0 * np.array([fit.freedom for fit in fits]) / alike)

    def _overlaps(
        self, inputs: NDArray[np.intp], frequencies: NDArray[np.intp]
    ) -> NDArray[np.complex128]:
        """What any two points share for unit noise, shape (n_in, n_f, n_in, n_f)."""
        n_in, n_f = len(inputs), len(frequencies)
        shared = np.zeros((n_in, n_f, n_in, n_f), dtype=np.complex128)
        for a, first in enumerate(frequencies):
            for b, second in enumerate(frequencies[: a + 1]):
                overlap = _overlap(self.fits[first], self.fits[second])[np.ix_(inputs, inputs)]
                shared[:, a, :, b], shared[:, b, :, a] = overlap, overlap.conj().T
        return shared

    def _block(
        self,
        overlap: NDArray[np.complex128],
        wanted: Sequence[Points],
        one: Points,
        other: Points,
    ) -> NDArray[np.float64]:
        """Covariance of the points of one output with those of another."""
        inputs, frequencies = union(wanted)
        rows = np.searchsorted(inputs, one.inputs)
        columns = np.searchsorted(inputs, other.inputs)
        first = np.searchsorted(frequencies, one.frequencies)
        second = np.searchsorted(frequencies, other.frequencies)
        shared = overlap[np.ix_(rows, first, columns, second)]
        level = np.sqrt(
            np.multiply.outer(
                self.noise.density[one.output, one.frequencies],
                self.noise.density[other.output, other.frequencies],
            )
        )
        turn = self.noise.coherency_at(self.noise.omega_rad_s)[:, other.output, one.output]
        # The conjugate is on the first index of coherency; between two frequencies, their mean.
        both = 0.5 * np.add.outer(turn[one.frequencies], turn[other.frequencies])
        found = (shared * (level * both)[None, :, None, :]).reshape(
            len(rows) * len(first), len(columns) * len(second)
        )
        return np.asarray(0.5 * np.block([[found.real, -found.imag], [found.imag, found.real]]))


def _parts(points: Points) -> tuple[int, int, int, int]:
    """Shape of errors by part (real, imaginary), input, frequency and row of a gain."""
    return 2, len(points.inputs), len(points.frequencies), -1


def _shared_bins(first: LocalFit, second: LocalFit) -> int:
    pairs = zip(first.places, second.places, strict=True)
    return sum(max(min(a.stop, b.stop) - max(a.start, b.start), 0) for a, b in pairs)


def _overlap(first: LocalFit, second: LocalFit) -> NDArray[np.complex128]:
    n_in = first.gain.shape[0]
    total = np.zeros((n_in, n_in), dtype=np.complex128)
    for one, other, a, b in zip(
        first.weights, second.weights, first.places, second.places, strict=True
    ):
        start, stop = max(a.start, b.start), min(a.stop, b.stop)
        if start < stop:
            left = one[:, start - a.start : stop - a.start]
            right = other[:, start - b.start : stop - b.start]
            total += left @ right.conj().T
    return total
