"""Weights that the inputs fix: what each window's output transform adds to a response."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.windows.halving import Halves
from flightid.responses.windows.kept_bases import basis_of, kept
from flightid.responses.windows.transform import FoldedBasis, WindowPlan, transform

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Places = NDArray[np.intp]


@dataclass(frozen=True)
class WindowShare:
    """What one window length adds to an estimate.

    Attributes
    ----------
    plan : WindowPlan
    projection : ndarray of complex, shape (n_f, n_in, n_instruments)
        Takes a window's conjugate instrument transforms to the weight of its output transform.
    """

    plan: WindowPlan
    projection: Complex


@dataclass(frozen=True)
class WindowWeights:
    """Instruments, windows and projections: all that the weights are made from.

    Attributes
    ----------
    instruments : tuple of ndarray, each shape (n_instruments, n_samples)
        Inputs, or excitations of a closed loop, of each record.
    omega : ndarray, shape (n_f,)
        Frequencies, rad per sample.
    detrend : str
    shares : tuple of WindowShare
    """

    instruments: tuple[Real, ...]
    omega: Real
    detrend: str
    shares: tuple[WindowShare, ...]

    def bases(self, frequencies: Places) -> list[FoldedBasis]:
        """Tapered sinusoids of each window length."""
        omega = self.omega[frequencies]
        return [basis_of(share.plan, omega, self.detrend) for share in self.shares]

    def weights_at(self, inputs: Places, frequencies: Places) -> list[list[Complex]]:
        """Weight of each window's output transform, by record and window length.

        Returns
        -------
        list of list of ndarray, each shape (n_in, n_f, n_windows)
        """
        return self.weights_by(self.bases(frequencies), inputs, frequencies)

    def weights_by(
        self, bases: list[FoldedBasis], inputs: Places, frequencies: Places
    ) -> list[list[Complex]]:
        """As `weights_at`, with the bases at these frequencies given."""

        def make() -> _Kept:
            made = [
                [
                    self._weights(record, share, basis, inputs, frequencies)
                    for share, basis in zip(self.shares, bases, strict=True)
                ]
                for record in map(Halves, self.instruments)
            ]
            return self, made

        # The key is of this object, which lives as long as what is kept for it.
        return kept(
            lambda: ("weights", id(self), inputs.tobytes(), frequencies.tobytes()),
            make,
            lambda found: sum(each.nbytes for record in found[1] for each in record),
        )[1]

    def _weights(
        self,
        record: Halves,
        share: WindowShare,
        basis: FoldedBasis,
        inputs: Places,
        frequencies: Places,
    ) -> Complex:
        if not share.plan.count(record.samples.shape[1]):
            return np.zeros((len(inputs), len(frequencies), 0), dtype=np.complex128)
        real, imaginary = transform(record, basis)
        projection = share.projection[frequencies][:, inputs]
        return np.asarray((projection @ (real - 1j * imaginary)).transpose(1, 0, 2))


_Kept = tuple[WindowWeights, list[list[Complex]]]
"""Weights with whose they are."""
