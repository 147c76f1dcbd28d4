"""What disturbs the rate in a short stretch: gyro noise behind its filter, and the air.

The covariance of the measured rate about the vehicle's answer, from the first sample of a stretch
on. What a stretch begins with (rate, slow gust) is drawn, not estimated: numbers of each stretch
would have to be estimated from a few samples whose noise the loop has fed back, which bends what
all stretches share, however many there are.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
SOURCES = ("gyro", "reading", "air", "rate", "push", "drift")
"""Gyro noise behind the filter, noise of reading, white acceleration, first rate, and of slow gusts
the acceleration that they begin with and its random walk."""
BELOW_NYQUIST = 0.9
"""Of half of the rate of the ticks, up to which a corner can be a filter's."""
TAIL = 4096
"""Samples of an impulse response, twice: its spectrum is that of the noise."""
STEP = 1e-5
"""Of a difference quotient by a partial correlation."""
LARGEST_PARTIAL = 0.98
"""Where a search begins."""
TICKS = (1, 8)
"""Of the gyro's filter in a sample: it runs with the loop, or in the driver, far above it."""


@dataclass(frozen=True)
class NoiseShape:
    """Shapes of the sources in the measured rate; their sizes come apart.

    Attributes
    ----------
    count : int
        Samples of the longest stretch.
    sample_time_s : float
    gyro_filter_hz : float
        Corner of the gyro's two-pole filter, Hz; 0 where there is none.
    damping : float
        Rate damping L of the vehicle, 1/s, as the sources of the air feel it.
    ticks : int
        Of the filter in a sample.
    """

    count: int
    sample_time_s: float
    gyro_filter_hz: float
    damping: float
    ticks: int = 1

    @cached_property
    def _filter(self) -> tuple[Array, Array]:
        """Numerator and denominator by ticks; one where there is no such filter."""
        rate = self.ticks / self.sample_time_s
        if not 0.0 < self.gyro_filter_hz < 0.5 * BELOW_NYQUIST * rate:
            return np.ones(1), np.ones(1)
        b, a = scipy.signal.butter(2, self.gyro_filter_hz, fs=rate)
        return np.asarray(b), np.asarray(a)

    @cached_property
    def _spectrum(self) -> Array:
        """Of white noise behind the filter, as samples show it."""
        response = np.zeros(TAIL * self.ticks)
        response[0] = 1.0
        response = scipy.signal.lfilter(*self._filter, response)
        lags = np.fft.irfft(np.abs(np.fft.rfft(response, 2 * len(response))) ** 2)
        return np.asarray(np.fft.rfft(lags[:: self.ticks]).real)

    def gyro(self, partial: Array) -> Array:
        """Covariance of noise of unit variance behind the filter, white or coloured before it.

        Parameters
        ----------
        partial : ndarray
            Partial correlations of its colour, before the hyperbolic tangent; none: white.
        """
        colour = np.fft.rfft(np.concatenate([[1.0], -_weights(partial)]), 2 * TAIL)
        lags = np.fft.irfft(self._spectrum / np.abs(colour) ** 2)[: self.count]
        return np.asarray(scipy.linalg.toeplitz(lags / lags[0]))

    @cached_property
    def fixed(self) -> tuple[Array, ...]:
        """Covariances of the other sources, for sizes of one, in their order."""
        h = self.sample_time_s / self.ticks
        decay = np.exp(self.damping * h * np.arange(self.count * self.ticks))
        settled = (
            scipy.signal.lfilter_zi(*self._filter) if len(self._filter[1]) > 1 else np.zeros(0)
        )
        rate = scipy.signal.lfilter(*self._filter, decay, zi=settled)[0][:: self.ticks]
        push = h * np.cumsum(scipy.signal.lfilter(*self._filter, decay))
        push = np.concatenate([[0.0], push])[:-1][:: self.ticks]
        # What acts within a sample acts at its middle.
        air = scipy.signal.lfilter(*self._filter, decay)[self.ticks // 2 :: self.ticks]
        steps = np.sqrt(self.sample_time_s) * scipy.linalg.toeplitz(air, np.zeros(self.count))
        walks = np.sqrt(self.sample_time_s) * scipy.linalg.toeplitz(push, np.zeros(self.count))
        white, walked = steps @ steps.T, walks @ walks.T
        return np.eye(self.count), white, np.outer(rate, rate), np.outer(push, push), walked


@dataclass(frozen=True)
class TwitchNoise:
    """A shape with sizes.

    Attributes
    ----------
    shape : NoiseShape
    sizes : ndarray, shape (6,)
        Logarithms of the deviations of `SOURCES`: rad/s, rad/s, rad/s^1.5, rad/s, rad/s²,
        rad/s^2.5.
    partial : ndarray
        Colour of the gyro's noise before its filter.
    """

    shape: NoiseShape
    sizes: Array
    partial: Array

    @property
    def numbers(self) -> Array:
        """All that is estimated."""
        return np.concatenate([self.sizes, self.partial])

    def at(self, numbers: Array) -> TwitchNoise:
        """The same shape with other numbers."""
        split = len(self.sizes)
        return replace(self, sizes=numbers[:split], partial=numbers[split:])

    def covariance(self) -> Array:
        """Of the measured rate, (count, count); that of a shorter stretch is its beginning."""
        parts = (self.shape.gyro(self.partial), *self.shape.fixed)
        return np.asarray(
            sum(np.exp(2.0 * s) * each for s, each in zip(self.sizes, parts, strict=True))
        )

    def slopes(self) -> list[Array]:
        """Derivatives of the covariance by each of the numbers."""
        parts = (self.shape.gyro(self.partial), *self.shape.fixed)
        found = [2.0 * np.exp(2.0 * s) * each for s, each in zip(self.sizes, parts, strict=True)]
        for place in range(len(self.partial)):
            moved = self.partial.copy()
            moved[place] += STEP
            change = (self.shape.gyro(moved) - parts[0]) / STEP
            found.append(np.exp(2.0 * self.sizes[0]) * change)
        return found


def _weights(partial: Array) -> Array:
    """Autoregression of partial correlations, which is stable wherever they are below one."""
    weights = np.zeros(0)
    for each in np.tanh(partial):
        weights = np.concatenate([weights - each * weights[::-1], [each]])
    return weights


def partial_of(lags: Array) -> Array:
    """Partial correlations, by their inverse hyperbolic tangents, of autocovariances from lag 0 on.

    Reference
    ---------
    Durbin (1960), Review of the International Statistical Institute 28.
    """
    weights, found = np.zeros(0), []
    left = lags[0]
    for order in range(1, len(lags)):
        each = (lags[order] - weights @ lags[order - 1 : 0 : -1]) / left
        found.append(float(np.clip(each, -LARGEST_PARTIAL, LARGEST_PARTIAL)))
        weights = np.concatenate([weights - found[-1] * weights[::-1], found[-1:]])
        left *= 1.0 - found[-1] ** 2
    return np.arctanh(found)
