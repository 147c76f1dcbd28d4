"""Noise of rates and accelerometers on its way to the outputs: it integrates to random walks.

A sample of input noise moves the state for the rest of the record. With X(t) the derivative of the
state by the initial state, the output i answers noise n by ``c_i(t) X(t) sum_{s<t} g(s) n(s)``,
``g(s)`` being the noise of one step brought back to the start. Both factors come from the native
sensitivities, so the map and its transpose are running sums: no matrix of n x n samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
# A Hann window's power over n samples, and the median of a chi-square with two degrees over its
# mean: with both a median ordinate stands for the variance of white noise.
HANN_POWER = 3 / 8
"""Mean square of the Hann window."""
MEDIAN_OF_EXPONENTIAL = float(np.log(2))
"""Median over mean of the power of noise at a frequency."""


def white_deviation(samples: Array) -> float:
    """Standard deviation of the white noise in a channel, by the upper half of its spectrum.

    The median there is not moved by lines of vibration; motion lies below.

    Assumes: noise that is white up to half the sampling frequency. Biased when: the channel was
    low-passed below a quarter of its sampling frequency (too small), or the motion reaches beyond
    that (too large).

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples of the channel.

    Returns
    -------
    float
        In the unit of the channel.

    Reference
    ---------
    Bendat & Piersol, Random Data (4th ed.), section 8.5.1 (distribution of raw spectra).

    Example
    -------
    >>> time_s = np.arange(4000) / 50
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(4000)
    >>> round(white_deviation(np.sin(time_s) + noise), 3)
    0.01
    """
    n = samples.size
    window = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(n) + 0.5) / n)
    power = np.abs(np.fft.rfft(window * (samples - samples.mean()))) ** 2 / (n * HANN_POWER)
    return float(np.sqrt(np.median(power[n // 4 :]) / MEDIAN_OF_EXPONENTIAL))


@dataclass(frozen=True, eq=False)
class InputNoise:
    """White noise of the inputs, and how it reaches the outputs.

    Attributes
    ----------
    deviations : ndarray, shape (6,)
        Standard deviations of the inputs' noise as measured, unit of each input.
    by_start : ndarray, shape (n_outputs, n, 6)
        Derivatives of the outputs by the initial state.
    steps : ndarray, shape (n - 1, 6, 6)
        Noise of the inputs (last axis) in one step, as a change of the initial state.
    late : ndarray of int, shape (n_outputs,)
        Samples by which each output lags.
    """

    deviations: Array
    by_start: Array
    steps: Array
    late: NDArray[np.int_]

    def outputs_of(self, noise: Array) -> Array:
        """Outputs (n_outputs, n, n_draws) that answer draws of unit noise (n - 1, 6, n_draws)."""
        walk = np.zeros((noise.shape[0] + 1, *noise.shape[1:]))
        np.cumsum((self.steps * self.deviations) @ noise, axis=0, out=walk[1:])
        return np.array(
            [
                np.einsum("nx,nxd->nd", slope, walk[self._reached(late)])
                for slope, late in zip(self.by_start, self.late, strict=True)
            ]
        )

    def transposed(self, weights: Array) -> Array:
        """Transpose of `outputs_of`: (n_outputs, n, k) to (n - 1, 6, k)."""
        n = self.by_start.shape[1]
        gathered = np.zeros((n, 6, weights.shape[2]))
        for slope, late, weight in zip(self.by_start, self.late, weights, strict=True):
            np.add.at(gathered, self._reached(late), slope[:, :, None] * weight[:, None, :])
        later = np.cumsum(gathered[:0:-1], axis=0)[::-1]
        return np.asarray((self.steps * self.deviations).transpose(0, 2, 1) @ later)

    def _reached(self, late: int) -> NDArray[np.int_]:
        """Sample whose state each sample of a lagging output shows."""
        n = self.by_start.shape[1]
        return np.clip(np.arange(n) - late, 0, n - 1)
