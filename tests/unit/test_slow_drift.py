"""Slow noise: drifts beside faster noise are found, and hide no missing dynamics."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov, toeplitz
from scipy.signal import lfilter

import flightid as fid
from flightid.uncertainty.driven_noise import _ringing, driven_products
from flightid.uncertainty.periodograms import first_lags, periodogram, transform_length
from flightid.uncertainty.residual_noise import (
    Autoregression,
    _fitted,
    _likelihood,
    _rounds,
    autoregression,
)
from flightid.uncertainty.slow_drift import FASTEST, SLOWEST, Drift, is_slow, whittle
from tests.closeness import assert_close
from tests.drift_rounds import parted
from tests.strangers import noises, output_error

N = 1500


def test_a_drifts_spectrum_is_that_of_its_autocovariance() -> None:
    drift = Drift(2.0, 0.05)
    found = np.fft.irfft(drift.spectrum(4096), 4096)[:40]
    assert_close(found, drift.autocovariance(40), why="poles fade over 4096", rtol=1e-9)


def test_columns_are_squared_by_the_covariance_of_recursion_and_drift() -> None:
    weights = np.array([1.6, -0.8])
    lags = np.array([1.0, 1.6 / 1.8, 1.6 * 1.6 / 1.8 - 0.8])
    noise = Autoregression(lags, weights, 60, 128, Drift(2.0, 0.05))
    columns = np.random.default_rng(0).standard_normal((60, 3))
    exact = columns.T @ toeplitz(noise.autocovariance(60)) @ columns
    assert_close(noise.squared(columns), exact, why="the same sums", rtol=1e-11)
    # What rings on, by SciPy's equation; where squares lose their digits it is sent through.
    for poles, is_told in (
        ([0.5], True), ([0.9, -0.3], True), ([0.99, 0.5, 0.2], True), ([0.0, 0.0], True),
        ([0.9999, 0.99989, 0.99988, 0.99987], False),
    ):  # fmt: skip
        denominator = np.poly(poles)
        order = denominator.size - 1
        turn = np.eye(order, k=1)
        turn[:, 0] -= denominator[1:]
        first = np.zeros((order, order))
        first[0, 0] = 1.0
        found = _ringing(denominator)
        assert (found is not None) == is_told, poles
        if found is not None:
            wanted = solve_discrete_lyapunov(turn.T, first)
            assert_close(found, wanted, rtol=1e-8, atol=1e-12, why="doubling")


def test_a_recursion_of_poles_that_lie_together_rings_on_as_long_as_it_does() -> None:
    """Squares of its matrix lose all digits; the impulse response of equal poles is binomial."""
    order, pole = 10, 0.9
    above = np.arange(4000)[:, None] + np.arange(1, order)
    response = np.prod(above / np.arange(1, order), axis=1) * pole ** np.arange(4000)
    impulse = np.array([[1.0]])
    found = driven_products(impulse, np.poly([pole] * order))
    assert_close(
        found[0, 0],
        response @ response,
        why="roundings of the coefficients move poles by 1e-2",
        rtol=1e-3,
    )


def test_what_a_drift_leaves_unknown_is_by_the_slopes_of_its_level() -> None:
    """Against Whittle's information by differences of the spectrum."""
    fast, drift, length, n, step = np.full(2049, 1.0), Drift(0.3, 0.01), 4096, 2000, 1e-5

    def level(fast_by: float, slow_by: float, corner_by: float) -> np.ndarray:
        moved = Drift(0.3 * np.exp(slow_by), 0.01 * np.exp(corner_by))
        return np.log(np.exp(fast_by) * fast + moved.spectrum(length))

    slopes = np.array([(level(*ahead) - level(*-ahead)) / (2 * step) for ahead in step * np.eye(3)])
    information = 0.5 * n * slopes @ slopes.T / fast.size
    exact = np.einsum("ib,ij,jb->b", slopes, np.linalg.inv(information), slopes)
    assert_close(drift.doubt(fast, n, length), exact, rtol=1e-5, why="central differences")


@pytest.mark.parametrize(("excess", "slow"), [(7.0, True), (5.0, False)])
def test_a_look_is_worth_one_and_a_half_deviations(excess: float, *, slow: bool) -> None:
    # Four half cycles of n samples are eight bins of twice the length: a deviation is four.
    ratio = np.ones(1001)
    ratio[2] += excess
    assert is_slow(ratio, 1000, 2000) is slow


@pytest.mark.parametrize("seed", range(4))
def test_a_walk_under_white_noise_is_found(seed: int) -> None:
    random = np.random.default_rng(seed)
    pole = 0.995
    drive = np.sqrt(0.3 * (1.0 - pole**2)) * random.standard_normal(N + 4000)
    slow = lfilter([1.0], [1.0, -pole], drive)[4000:]
    noise = random.standard_normal(N) + slow - slow.mean()
    model = autoregression(periodogram(noise[:, None]), N)
    assert model.drift is not None
    assert not model.is_white
    # White noise of unit variance, and within a factor what the walk adds to slow bins.
    assert_close(model.lags[0], 1.0, why="1500 samples", rtol=0.15)
    truth = Drift(0.3, 1.0 - pole).spectrum(model.length)
    octave = slice(2, 9)
    ratio = np.mean(model.drift.spectrum(model.length)[octave]) / np.mean(truth[octave])
    assert 0.2 < ratio < 5.0
    # What is known of its level: some bins at zero frequency, nearly all samples far above it.
    slow_level, fast_level = model.freedom(np.array([np.inf, 1.05 * float(model.lags[0])]))
    assert slow_level < 8.0
    assert fast_level > 40.0


@pytest.mark.parametrize("seed", range(4))
def test_rounds_end_where_more_of_them_would(seed: int) -> None:
    """At every corner a hundred rounds, and Whittle's likelihood of what they end in."""
    random = np.random.default_rng(seed)
    power = periodogram(noises.drift(random, N)[:, None] + noises.ar1(random, N, 0.5)[:, None])
    found = autoregression(power, N)
    assert found.drift is not None
    ends, fitted = [], partial(_fitted, n=N, length=found.length)
    for corner in np.geomspace(SLOWEST / N, FASTEST, 4):
        fast, slow = fitted(power), Drift(0.3 * power.mean(), corner)
        for _ in range(100):
            fast, slow = parted(fitted, power, found.length, (fast, slow), 1)
        level = fast.spectrum() + slow.spectrum(found.length)
        worth = -N * np.mean(np.log(level) + power / level) - fast.order * np.log(N)
        ends.append((worth, slow))
    best = max(ends, key=lambda each: each[0])[1]
    assert found.drift.corner == pytest.approx(best.corner, rel=1e-12)
    assert_close(found.drift.variance, best.variance, rtol=1e-6, why="rounds end at 1e-7")


def test_native_rounds_are_those_of_the_models_themselves() -> None:
    """White, coloured and nearly a line; few samples, where rounds meet what is no power; many."""
    for n, pole in ((N, 0.0), (N, 0.7), (N, -0.95), (60, 0.5), (20_000, 0.7)):
        random = np.random.default_rng(n)
        power = periodogram(noises.drift(random, n)[:, None] + noises.ar1(random, n, pole)[:, None])
        power[1:] -= 0.9 * power[:-1].min()
        length, whole = transform_length(n), np.maximum(power, 0.0)
        model = partial(_fitted, n=n, length=length)
        begun = model(whole), Drift(0.3 * float(whole.mean()), 0.02)
        for rounds in (1, 6, 300 if n < 2 * N else 20):
            native = _rounds(n, length, whole, begun, rounds)
            own = parted(model, whole, length, begun, rounds)
            assert native[0].weights.size == own[0].weights.size
            assert_close(native[0].lags, own[0].lags, why="rounding", rtol=1e-9, atol=1e-12)
            assert_close(native[0].weights, own[0].weights, why="rounding", rtol=1e-8)
            assert_close(native[1].variance, own[1].variance, why="rounding", rtol=1e-9)
            assert native[1].corner == own[1].corner
            whole_spectrum = own[0].spectrum() + own[1].spectrum(length)
            found, told = _likelihood(n, length, whole, own), whittle(whole_spectrum, whole, n)
            assert_close(found, told, why="rounding", rtol=1e-9)


@pytest.mark.parametrize("length", [64, 65])
def test_a_round_shares_the_power_of_all_bins_and_has_no_unit(length: int) -> None:
    power = np.random.default_rng(7).exponential(size=length // 2 + 1)
    power[-1] = 200.0  # the highest bin of an even transform stands alone in the whole circle
    flat, drift = np.full(power.size, 1e-2), Drift(0.3, 0.3)

    def ended(unit: float, rounds: int) -> Drift:
        fast = SimpleNamespace(spectrum=lambda: unit * flat)
        begun = Drift(unit * drift.variance, drift.corner)
        return parted(lambda _: fast, unit * power, length, (fast, begun), rounds)[1]

    own = drift.spectrum(length)
    share = own / (own + flat)
    slow = share**2 * power + share * flat
    circle = np.r_[slow, slow[1 : (length + 1) // 2][::-1]]
    assert circle.size == length
    assert_close(ended(1.0, 1).variance, circle.mean(), rtol=1e-12, why="the mean over the circle")
    many = ended(1.0, 40).variance
    assert many != ended(1.0, 2).variance
    for unit in (1e-6, 1e6):
        assert_close(ended(unit, 40).variance / unit, many, rtol=1e-12, why="power has a unit")


@pytest.mark.parametrize("seed", range(4))
def test_white_noise_has_none(seed: int) -> None:
    noise = np.random.default_rng(seed).standard_normal((N, 1))
    model = autoregression(periodogram(noise), N)
    assert model.is_white
    assert model.order == 0


def test_slow_noise_does_not_hide_a_missing_lag() -> None:
    late = output_error.late(3, 0.01, 0.1, partial(noises.ar1, pole=0.9))
    fit = fid.identify(output_error.model(), late, method="output_error")
    assert any(found.code == "inputs-in-errors" for found in fit.findings)
    assert fit.covariance is None


@pytest.mark.parametrize(("length", "often"), [(8, False), (8, True), (9, True)])
def test_lags_of_a_padded_periodogram_are_those_of_the_samples(length: int, often: bool) -> None:
    values = np.array([1.0, -2.0, 0.5, 3.0])
    power = np.abs(np.fft.rfft(values, length)) ** 2
    found = first_lags(power, length, 2, often=often)
    wanted = [float(values[k:] @ values[: 4 - k]) for k in range(3)]
    assert_close(found, np.array(wanted), rtol=1e-12, why="Wiener and Khinchin")


@pytest.mark.parametrize("length", [65_536, 70_001])
def test_first_lags_of_a_long_periodogram_are_those_of_the_samples(length: int) -> None:
    n = 30_000
    values = np.cumsum(np.random.default_rng(5).standard_normal(n))
    power = np.abs(np.fft.rfft(values, length)) ** 2
    wanted = np.array([float(values[k:] @ values[: n - k]) for k in range(21)])
    assert_close(first_lags(power, length, 20), wanted, rtol=1e-14, why="Wiener and Khinchin")
