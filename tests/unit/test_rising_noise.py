"""Noise that rises towards zero frequency is read by octaves there, and known from few bins."""

from __future__ import annotations

import numpy as np

from flightid.responses.errors.noise import NoiseSpectrum, mean_spectrum
from flightid.responses.errors.rising_noise import sure_slope
from tests.strangers import noises

STEP_S, SAMPLES, POLE = 0.02, 1000, 0.98


def spectrum(random: np.random.Generator, pole: float) -> NoiseSpectrum:
    """Of one record of 20 s."""
    residual = noises.ar1(random, SAMPLES, pole)[None]
    return mean_spectrum([residual], STEP_S, 15.0, [np.zeros((1, (SAMPLES - 1) // 2))])


def test_drift_is_as_strong_at_its_lowest_bins_as_it_is() -> None:
    omega = np.array([0.6, 1.0, 2.0])
    white = 2.0 * STEP_S * (1.0 - POLE**2)
    truth = white / np.abs(1.0 - POLE * np.exp(-1j * omega * STEP_S)) ** 2
    random = np.random.default_rng(2)
    found = np.mean([spectrum(random, POLE).at(omega)[0] for _ in range(100)], axis=0)
    # One mean of the first 15 bins tells 0.3 and 0.5 of the first two.
    assert np.all(np.abs(found / truth - 1.0) < 0.3)


def test_few_bins_are_few_degrees_of_freedom() -> None:
    random = np.random.default_rng(3)
    levels = spectrum(random, POLE).levels_of(0)
    assert levels is not None
    assert levels.freedom[:3].tolist() == [6.0, 8.0, 16.0]
    flat = spectrum(random, 0.0).levels_of(0)
    assert flat is not None
    assert np.all(flat.freedom >= 30.0)


def test_white_noise_seldom_rises_for_sure() -> None:
    random = np.random.default_rng(4)
    omega = np.arange(1.0, 16.0)
    power = random.exponential(size=(2000, 15))
    assert np.mean(sure_slope(omega, power) < 0.0) < 0.2
    assert np.mean(sure_slope(omega, power * omega**-2) < 0.0) > 0.98
