"""Steps from ordinary flying beside two other ways, written here from their formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import csd, welch

from flightid.review.deconvolution import closed_loop
from flightid.review.loop_samples import LoopSamples
from tests.strangers.ordinary_flights import HAND_S, Axis, ordinary, step
from tests.strangers.ordinary_steps import CREEPING, fly_samples, truths

Array = NDArray[np.float64]
STEP_S, SHOWN = 0.01, 45
"""Sample time, and samples that are compared: 0.45 s, within the frames of the peers."""
AXIS = Axis(gust=0.2, noise=0.01)


@pytest.fixture(scope="module")
def samples() -> LoopSamples:
    flown = ordinary(AXIS, 3, 90.0, acro=True, size=1.5)
    rows = flown.rate_wanted[::4], flown.rate[::4], flown.angle[::4]
    return LoopSamples.of([rows], STEP_S, 1)


def wiener(r: Array, y: Array, *, cut_hz: float = 25.0) -> Array:
    """PID-Analyzer: Wiener deconvolution of Hann frames, and their mean.

    Its own frames last 1 s and lose what lasts longer than a part of that (0.78 here, where the
    truth is 0.92); these last 4 s.

    Each frame's pulse response is Y R* / (R R* + 1 / s), s a signal-to-noise of 10 that falls
    smoothly to nothing above the cut; quiet frames do not count.
    """
    length, padded = 400, 1024
    starts = range(0, r.size - length, length // 16)
    taper = np.hanning(length)
    inputs = np.array([r[k : k + length] * taper for k in starts])
    outputs = np.array([y[k : k + length] * taper for k in starts])
    loud = np.abs(inputs).max(axis=1) > np.median(np.abs(inputs).max(axis=1))
    spectra_in, spectra_out = np.fft.fft(inputs, padded), np.fft.fft(outputs, padded)
    frequency = np.abs(np.fft.fftfreq(padded, STEP_S))
    passed = (frequency < cut_hz).astype(float)
    trust = 10.0 * gaussian_filter1d(passed, passed.sum() / 6.0, mode="wrap") + 1e-9
    pulses = np.fft.ifft(
        spectra_out * spectra_in.conj() / (np.abs(spectra_in) ** 2 + 1.0 / trust)
    ).real
    # Louder frames are deconvolved with less damping: weigh them by their power.
    weights = (np.abs(inputs[loud]) ** 2).sum(axis=1)
    mean = np.average(pulses[loud], axis=0, weights=weights)
    return np.cumsum(mean)[:SHOWN]


def by_spectra(r: Array, y: Array) -> Array:
    """Quotient of scipy's Welch spectra, back in time."""
    length = 512
    _, cross = csd(r, y, 1.0 / STEP_S, nperseg=length, detrend="constant")
    _, power = welch(r, 1.0 / STEP_S, nperseg=length, detrend="constant")
    pulses = np.fft.irfft(cross / (power + 1e-5 * power.max()), length)
    return np.cumsum(pulses)[:SHOWN]


def test_two_other_ways_find_the_same_step(samples: LoopSamples) -> None:
    ours = closed_loop(samples).step(SHOWN)[0]
    ticks = step(AXIS, 1.0)
    middles = (np.arange(SHOWN) + 0.5) * STEP_S - 0.5 / AXIS.loop_hz
    truth = np.interp(middles, np.arange(ticks.size) / AXIS.loop_hz, ticks)
    # Its damping is meant for deg/s.
    r, y = np.degrees(samples.set_point), np.degrees(samples.measured)
    assert np.abs(ours - truth)[1:].max() < 0.03
    assert np.abs(by_spectra(r, y) - ours).max() < 0.06
    assert np.abs(wiener(r, y) - ours).max() < 0.08


@pytest.mark.parametrize(
    ("lag_s", "gust", "most"),
    [(HAND_S, 0.2, 0.004), (0.0, 0.05, 0.002)],
    ids=["by hand", "jumping"],
)
def test_steps_are_not_too_low(lag_s: float, gust: float, most: float) -> None:
    """Lags of half a second forget what an integrator remembers: 7 of 7 levels were too low.

    Of rows that a sample leaves out it does not know when a set-point jumped: a quarter of a
    percent. A minute of gusts makes levels too high by as much as their own scatter, 0.4 % of jumps
    in gusts of 0.2 rad/s^2, and nothing without gusts: weaker ones tell the rows apart.
    """
    calm, seeds = replace(CREEPING, gust=gust, noise=0.005), range(3)
    _, exact = truths(calm, 4, 200)
    off = [
        closed_loop(fly_samples(seed, calm, acro=False, lag_s=lag_s)).step(200)[0, 100:]
        - exact[100:]
        for seed in seeds
    ]
    assert abs(np.mean(off)) < most
