"""Finite Fourier integrals ∫ x(t) exp(−jωt) dt of sampled records, by cubics between samples.

At the harmonics of a record's length constants vanish, and the ends of the record add one constant
for all frequencies to the transform of a derivative. A plain sum of samples is wrong at the ends
of the record and for fast harmonics; cubics between the samples are right to fourth order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from flightid.errors import DataError, OptionError

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_NODES = 16
FEWEST_SAMPLES = 16
FEWEST_HARMONICS = 4
HIGHEST_SHARE = 0.4
"""Highest share of the Nyquist frequency that cubics between samples still follow."""


@dataclass(frozen=True)
class Harmonics:
    """Harmonics 2πk/T of one record inside a band.

    Attributes
    ----------
    numbers : ndarray of int, shape (n_f,)
        k, from 1 up.
    n_samples : int
    sample_time_s : float

    Example
    -------
    >>> grid = Harmonics.inside((1.0, 5.0), 501, 0.02)
    >>> grid.omega_rad_s.round(2).tolist()
    [1.26, 1.88, 2.51, 3.14, 3.77, 4.4]
    """

    numbers: NDArray[np.intp]
    n_samples: int
    sample_time_s: float

    @classmethod
    def inside(
        cls, band: tuple[float, float] | None, n_samples: int, sample_time_s: float
    ) -> Harmonics:
        """All harmonics in a band (low, high), rad/s; None: to two fifths of Nyquist.

        Raises
        ------
        OptionError
            A band without meaning.
        DataError
            Too few samples, or fewer than four harmonics in the band.
        """
        nyquist = np.pi / sample_time_s
        low, high = band if band is not None else (0.0, HIGHEST_SHARE * nyquist)
        if not (np.isfinite(low) and 0.0 <= low < high <= HIGHEST_SHARE * nyquist * (1.0 + 1e-9)):
            raise OptionError(
                "the band has no meaning for this record",
                found=f"{low:g} to {high:g} rad/s",
                needed=f"0 <= low < high <= {HIGHEST_SHARE * nyquist:.4g} rad/s, "
                f"{HIGHEST_SHARE:g} of the Nyquist frequency",
            )
        if n_samples < FEWEST_SAMPLES:
            raise DataError(
                "too few samples for a Fourier integral",
                found=n_samples,
                needed=f"at least {FEWEST_SAMPLES}",
            )
        first = 2.0 * np.pi / ((n_samples - 1) * sample_time_s)
        edge = 1e-9
        numbers = np.arange(
            max(1, int(np.ceil(low / first - edge))), int(np.floor(high / first + edge)) + 1
        )
        if len(numbers) < FEWEST_HARMONICS:
            raise DataError(
                "the band holds too few harmonics of the record",
                found=f"{len(numbers)} between {low:.4g} and {high:.4g} rad/s, "
                f"{first:.4g} rad/s apart",
                needed=f"at least {FEWEST_HARMONICS}",
                action="widen the band, or take a longer record",
            )
        return cls(numbers, n_samples, sample_time_s)

    @property
    def omega_rad_s(self) -> Array:
        """Frequencies, rad/s."""
        length = (self.n_samples - 1) * self.sample_time_s
        return np.asarray(2.0 * np.pi * self.numbers / length)

    def integral(self, samples: Array) -> Complex:
        """∫ x(t) exp(−jωt) dt from the first sample to the last.

        Parameters
        ----------
        samples : ndarray, shape (..., n_samples)

        Returns
        -------
        ndarray of complex, shape (..., n_f)
            Unit of the samples times s.

        Reference
        ---------
        Press et al., *Numerical Recipes*, 3rd ed., §13.9; Klein & Morelli, *Aircraft System
        Identification*, §10.1 (finite Fourier transform).
        """
        angle = self.omega_rad_s * self.sample_time_s
        inner, ends = _weights(angle)
        # The last sample lies one whole period after the first.
        summed = fft.fft(samples[..., :-1], axis=-1)[..., self.numbers] + samples[..., -1:]
        edges = np.concatenate([samples[..., :4], samples[..., -4:]], axis=-1)
        return np.asarray(self.sample_time_s * (inner * summed + edges @ ends.T))

    def in_time(self, integrals: Complex) -> Array:
        """Sum of these harmonics at the samples' times, without mean.

        Parameters
        ----------
        integrals : ndarray of complex, shape (n, n_f)
            Such as `integral` gives.

        Returns
        -------
        ndarray, shape (n, n_samples)
        """
        # One period is one sample less than the record: its first and last sample are the same.
        period = self.n_samples - 1
        spectrum = np.zeros((len(integrals), period // 2 + 1), dtype=np.complex128)
        spectrum[:, self.numbers] = integrals / self.sample_time_s
        samples = fft.irfft(spectrum, period, axis=1)
        return np.concatenate([samples, samples[:, :1]], axis=1)


def _weights(angle: Array) -> tuple[Complex, Complex]:
    """Weight of the plain sum, and what the four samples at either end need besides.

    Inside, the cubic through four samples stands for the middle interval; at the ends the outer
    cubic stands for the outer interval too.
    """
    first, central, last = (_interval(angle, start) for start in range(3))
    turn = np.exp(-1j * np.multiply.outer(angle, np.arange(-3, 4)))
    # Sample m of an interval's four lies m − 1 samples from the interval's start.
    inner = sum(central[:, m] * turn[:, 3 - (m - 1)] for m in range(4))
    ends = np.zeros((len(angle), 8), dtype=np.complex128)
    ends[:, :4] += first
    ends[:, 4:] += last * turn[:, [2]]  # starts one sample before the end, at phase zero
    for place in range(4):
        # Intervals that the plain sum counts but that do not exist, or that the outer cubic takes.
        for start in range(-2, 1):
            m = place - start + 1
            if 0 <= m < 4:
                ends[:, place] -= central[:, m] * turn[:, 3 + start]
        for start in range(2, 5):
            m = place - start + 1
            if 0 <= m < 4:
                # Four samples end at 3, the last one; phases count from there, one period on.
                ends[:, 4 + place] -= central[:, m] * np.exp(-1j * angle * (start - 3))
    return np.asarray(inner), ends


def _interval(angle: Array, start: int) -> Complex:
    """∫₀¹ L_m(start + s) exp(−jθs) ds for the cubic cardinals L_m at 0, 1, 2, 3."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    s = 0.5 * (nodes + 1.0)
    cardinal = np.ones((4, _NODES))
    for m in range(4):
        for other in range(4):
            if other != m:
                cardinal[m] *= (start + s - other) / (m - other)
    wave = np.exp(-1j * np.multiply.outer(angle, s)) * (0.5 * weights)
    return np.asarray(wave @ cardinal.T)
