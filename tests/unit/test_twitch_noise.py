"""Noise of short stretches in a loop against formulas, and estimates that it no longer bends."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy

import flightid as fid
from flightid.conventions import Light
from flightid.review.autotune.twitch_noise import NoiseShape, TwitchNoise, partial_of
from tests.autotune_log import true_margins, write_ardupilot
from tests.closeness import assert_close
from tests.strangers.ordinary_flights import Axis

NOISY = Axis(gust=0.3, noise=0.2, p=0.08, i=0.08, d=0.002)
SHAPE = NoiseShape(count=40, sample_time_s=0.0025, gyro_filter_hz=30.0, damping=-3.0)


def test_noise_behind_a_fast_filter_has_the_covariance_of_a_butterworth_filter() -> None:
    found = replace(SHAPE, ticks=8).gyro(np.zeros(0))[0]
    lag = np.sqrt(2.0) * np.pi * 30.0 * 0.0025 * np.arange(40)
    assert_close(found, np.exp(-lag) * (np.cos(lag) + np.sin(lag)), atol=3e-3, why="by eighths")


def test_covariances_are_those_of_noise_that_is_drawn() -> None:
    """White noise through the filter of every tick and a colour of its own; and a white gust."""
    random, partial = np.random.default_rng(3), np.array([0.4, -0.2])
    first, second = np.tanh(partial)
    colour = [1.0, -(first - second * first), -second]
    b, a = scipy.signal.butter(2, 30.0, fs=400.0)
    drawn = random.standard_normal((4000, 440))
    seen = scipy.signal.lfilter(b, a, scipy.signal.lfilter([1.0], colour, drawn))[:, 400:]
    expected = SHAPE.gyro(partial)
    assert_close(seen.T @ seen / 4000 / np.var(seen), expected, atol=0.06, why="4,000 draws")
    air = SHAPE.fixed[1]
    steps = np.sqrt(0.0025) * drawn[:, :40]
    rate = scipy.signal.lfilter(b, a, scipy.signal.lfilter([1.0], [1.0, -np.exp(-0.0075)], steps))
    assert_close(rate.T @ rate / 4000, air, atol=0.06 * air.max(), why="4,000 draws")


def test_partial_correlations_are_those_of_an_autoregression() -> None:
    """Its own covariance gives back what made it."""
    partial = np.array([0.5, -0.3, 0.2])
    lags = NoiseShape(40, 0.0025, 0.0, -3.0).gyro(partial)[0]
    assert_close(partial_of(lags[:5]), np.append(partial, 0.0), atol=1e-9, why="Levinson's steps")


def test_slopes_of_a_covariance_are_its_difference_quotients() -> None:
    noise = TwitchNoise(SHAPE, np.log([0.1, 0.02, 0.3, 0.2, 0.4, 0.5]), np.array([0.3, -0.1]))
    for place, slope in enumerate(noise.slopes()):
        ends = []
        for side in (1e-4, -1e-4):
            numbers = noise.numbers.copy()
            numbers[place] += side
            ends.append(noise.at(numbers).covariance())
        assert_close(slope, (ends[0] - ends[1]) / 2e-4, atol=1e-6, why="central differences")


@pytest.fixture(scope="module")
def opinion(tmp_path_factory: pytest.TempPathFactory) -> tuple[fid.AutotuneReview, Axis]:
    path = tmp_path_factory.mktemp("noisy") / "autotune.bin"
    gains = write_ardupilot(path, NOISY, seed=2)
    return fid.review_autotune(path), replace(NOISY, p=gains.p, i=gains.p, d=gains.d)


def test_gyro_noise_that_the_loop_feeds_back_bends_no_margin(
    opinion: tuple[fid.AutotuneReview, Axis],
) -> None:
    """By output error K was 12 % too large here, and the phase margin 5 deg too small."""
    (roll,) = opinion[0].opinions
    assert roll.fit is not None
    assert roll.tuned is not None
    crossover, phase, gain = true_margins(opinion[1])
    told = ((roll.tuned.crossover, 2 * np.pi * crossover), (roll.tuned.phase_margin, phase))
    for found, exact in (*told, (roll.tuned.gain_margin, gain)):
        assert found.interval95 is not None
        assert found.interval95[0] <= exact <= found.interval95[1]
    low, high = roll.tuned.phase_margin.interval95 or (0.0, 90.0)
    assert high - low < 8.0
    for name, exact in (("K", NOISY.effectiveness), ("T_m", NOISY.motor_s), ("L", -3.0)):
        low, high = roll.fit.parameters[name].interval95 or (np.inf, -np.inf)
        assert low <= exact <= high


def test_twitches_that_noise_drowns_give_no_interval_and_say_why(tmp_path: Path) -> None:
    path = tmp_path / "few.bin"
    write_ardupilot(path, replace(NOISY, noise=0.4), most=6, seed=1)
    review = fid.review_autotune(path)
    (roll,) = review.opinions
    assert roll.tuned is not None
    assert roll.tuned.phase_margin.interval95 is None
    (said,) = (each for each in review.findings if each.code == "autotune-margins-roll")
    assert said.light is Light.AMBER
    assert "without intervals" in said.message
    assert "is told to" in said.message
    assert "rad/s behind the gyro's filter" in said.message
    assert "flightid plan" in said.action


def test_what_holds_the_vehicle_still_is_no_input_of_its_motion(tmp_path: Path) -> None:
    """A trim of 0.05 made 133 deg of 92; stamps that scatter gave each twitch a sample time."""
    axis, found = replace(NOISY, gust=0.0, noise=0.02), []
    for trim, jitter_s in ((0.0, 0.0), (-0.05, 4e-5)):
        path = tmp_path / f"{trim}.bin"
        write_ardupilot(path, axis, seed=2, most=10, trim=trim, jitter_s=jitter_s)
        (roll,) = fid.review_autotune(path).opinions
        assert roll.fit is not None
        assert roll.flown is not None
        found.append((roll.fit.parameters["K"].value, roll.flown.phase_margin.value))
        words = [each.message for each in roll.fit.evidence.findings]
        assert not any("sample times" in each for each in words), words
    assert_close(found[1], found[0], rtol=2e-3, why="the same flight but for trim and stamps")
