"""Finite Fourier sums Σ x(k) exp(−jωkT) of sampled records at the harmonics of their length.

There constants vanish, and the ends of a record add one number for all frequencies to the transform
of a difference from sample to sample. Differences of states are known from integrals over the
sample intervals, whatever the inputs do inside them, so no curve is laid through the samples.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
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

    def total(self, samples: Array) -> Complex:
        """Sum of the samples times exp(−jωt) over one period, times the sample time.

        No curve is laid through the samples: for what obeys difference equations, as inputs and
        outputs of a held model do, with jω x̃ exchanged for (exp(jωT) − 1) x̃.

        Parameters
        ----------
        samples : ndarray, shape (..., n_samples)
            The last one closes the period and is not counted; it may be left out.

        Returns
        -------
        ndarray of complex, shape (..., n_f)
            Unit of the samples times s.
        """
        spectrum = scipy.fft.fft(samples[..., : self.n_samples - 1], axis=-1)[..., self.numbers]
        return np.asarray(self.sample_time_s * spectrum)

    def lagged(self, samples: Array, n_lags: int) -> Array:
        """`total` of samples that come later by 0, 1, ... of them, for the price of one.

        What is before the first sample is taken to be it.

        Parameters
        ----------
        samples : ndarray, shape (n, n_samples)
        n_lags : int

        Returns
        -------
        ndarray, shape (n, n_lags, 2 n_f)
            Real parts, then imaginary parts.

        Example
        -------
        >>> grid = Harmonics.inside(None, 101, 0.02)
        >>> samples = np.random.default_rng(0).standard_normal((1, 101))
        >>> late = np.concatenate([samples[:, :1], samples[:, :-1]], axis=1)
        >>> one = grid.total(late)
        >>> np.allclose(grid.lagged(samples, 2)[:, 1], np.concatenate([one.real, one.imag], 1))
        True
        """
        period = self.n_samples - 1
        found, now = [], self.total(samples)
        for lag in range(n_lags):
            found.append(np.concatenate([now.real, now.imag], axis=1))
            # One sample enters at the start, another leaves at the end.
            change = samples[:, 0] - samples[:, max(period - 1 - lag, 0)]
            now = now / self.turn + self.sample_time_s * change[:, None]
        return np.stack(found, axis=1)

    @property
    def turn(self) -> Complex:
        """exp(jωT): one sample ahead, shape (n_f,)."""
        return np.asarray(np.exp(1j * self.omega_rad_s * self.sample_time_s))

    def in_time(self, integrals: Complex) -> Array:
        """Sum of these harmonics at the samples' times, without mean.

        Parameters
        ----------
        integrals : ndarray of complex, shape (n, n_f)
            Such as `total` gives.

        Returns
        -------
        ndarray, shape (n, n_samples)
        """
        # One period is one sample less than the record: its first and last sample are the same.
        period = self.n_samples - 1
        spectrum = np.zeros((len(integrals), period // 2 + 1), dtype=np.complex128)
        spectrum[:, self.numbers] = integrals / self.sample_time_s
        samples = scipy.fft.irfft(spectrum, period, axis=1)
        return np.concatenate([samples, samples[:, :1]], axis=1)
