"""Covariance of local polynomial estimates: what the bins of two fits share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.errors.noise import NoiseSpectrum
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
        overlap = self._overlaps(*union(wanted))
        total = np.zeros(2 * (len(gains[0]),))
        for place, (one, left) in enumerate(zip(wanted, gains, strict=True)):
            for other, right in zip(wanted[: place + 1], gains[: place + 1], strict=True):
                block = left @ self._block(overlap, wanted, one, other) @ right.T
                total += block if one is other else block + block.T
        return total

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
