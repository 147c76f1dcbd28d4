"""Periodograms, slow drifts and noise models beside sums that are written out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy

from flightid.uncertainty import periodograms, residual_noise, slow_drift
from flightid.uncertainty.residual_noise import Autoregression
from flightid.uncertainty.slow_drift import Drift
from tests.drift_rounds import parted

Array = np.ndarray


def whole(power: Array, length: int) -> Array:
    """All bins of a transform by those of a real one."""
    return power[np.minimum(np.arange(length), length - np.arange(length))]


def test_periodograms_are_sums_of_squares_over_samples() -> None:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((7, 3))
    angles = 2.0 * np.pi * np.outer(np.arange(9), np.arange(7)) / 16.0
    turned = np.exp(-1j * angles) @ columns
    assert periodograms.transform_length(7) == 15
    assert periodograms.transform_length(8) == 16
    assert periodograms.periodogram(columns, 16) == pytest.approx(
        (np.abs(turned) ** 2).sum(axis=1) / 3 / 7
    )
    assert periodograms.periodogram(columns).shape == (8,)
    other = rng.standard_normal((4, 2))
    known = 7 * periodograms.periodogram(columns, 16) + 4 * periodograms.periodogram(other, 16)
    assert periodograms.pooled([columns, other], 16) == pytest.approx(known / 11)
    assert periodograms.twice(6).tolist() == [1.0, 2.0, 2.0, 1.0]
    assert periodograms.twice(7).tolist() == [1.0, 2.0, 2.0, 2.0]


def test_a_record_sees_a_lag_less_often_than_a_sample() -> None:
    """White noise leaks nowhere; a lag of two is seen 6 + 3 times in 8 + 5 samples."""
    assert periodograms.leaking(np.full(9, 3.0), (8, 5), 16) == pytest.approx(3.0)
    place = 2.0 * np.pi * np.arange(9) / 16.0
    spectrum = 3.0 + np.cos(2.0 * place) + np.cos(6.0 * place)
    seen = 3.0 + (9.0 * np.cos(2.0 * place) + 2.0 * np.cos(6.0 * place)) / 13.0
    assert periodograms.leaking(spectrum, (8, 5), 16) == pytest.approx(seen)


def test_first_lags_are_those_of_the_whole_transform() -> None:
    """By a transform, by a table, and by spans where it is long: even and odd lengths."""
    rng = np.random.default_rng(1)
    for length, largest in ((16, 3), (15, 3)):
        power = rng.random(length // 2 + 1)
        angles = 2.0 * np.pi * np.outer(np.arange(largest + 1), np.arange(length)) / length
        known = np.cos(angles) @ whole(power, length) / length
        assert periodograms.cosines(length, largest) @ power == pytest.approx(known)
        for often in (False, True):
            found = periodograms.first_lags(power, length, largest, often=often)
            assert found == pytest.approx(known)
    for length, largest in ((40_000, 20), (40_001, 20), (49_152, 7), (32_769, 1), (65_536, 21)):
        power = rng.random(length // 2 + 1) * np.linspace(9.0, 1.0, length // 2 + 1) ** 3
        known = scipy.fft.irfft(power, length)[: largest + 1]
        found = periodograms.first_lags(power, length, largest, often=True)
        assert found == pytest.approx(known, rel=1e-13, abs=1e-14 * known[0])


def test_long_transforms_are_asked_by_spans_and_short_ones_by_tables(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[str] = []
    for name in ("_by_spans", "cosines"):
        monkeypatch.setattr(
            periodograms, name, lambda *_, name=name: asked.append(name) or np.zeros((1, 1))
        )
    for length, largest, often in (
        (32_768, 20, True),
        (32_769, 20, True),
        (32_769, 21, True),
        (32_768, 20, False),
        (32_769, 20, False),
    ):
        power = np.zeros(1 if often and length == 32_768 else length // 2 + 1)
        periodograms.first_lags(power, length, largest, often=often)
        asked.append("")
    assert "".join(each or "," for each in asked) == "cosines,_by_spans,,,_by_spans,"


def test_a_drift_is_a_first_order_recursion() -> None:
    drift = Drift(3.0, 0.04)
    lags = 3.0 * 0.96 ** np.arange(200)
    assert drift.autocovariance(4) == pytest.approx(lags[:4])
    angles = 2.0 * np.pi * np.arange(51) / 100.0
    known = 3.0 * (1.0 - 0.96**2) / np.abs(1.0 - 0.96 * np.exp(-1j * angles)) ** 2
    assert drift.spectrum(100) == pytest.approx(known)
    assert slow_drift.turns(100) == pytest.approx(1.0 - np.cos(angles))
    # Whittle's information by differences of the logarithm of the whole spectrum.
    fast = 2.0 + np.cos(angles)
    parts = (
        lambda s: np.exp(s) * fast + known,
        lambda s: fast + np.exp(s) * known,
        lambda s: fast + Drift(3.0, 0.04 * np.exp(s)).spectrum(100),
    )
    slopes = np.array([(np.log(part(1e-5)) - np.log(part(-1e-5))) / 2e-5 for part in parts])
    covariance = np.linalg.inv(0.5 * 80 * slopes @ slopes.T / 51)
    doubt = np.einsum("ib,ij,jb->b", slopes, covariance, slopes)
    assert drift.doubt(fast, 80, 100) == pytest.approx(doubt, rel=1e-4)


def test_octaves_with_more_power_than_chance_are_slow() -> None:
    """Of 1000 samples in 2000: 8, 16, 32 and 64 bins, each half a degree of freedom."""
    assert slow_drift.n_slow_bins(1000, 2000) == 65
    for last in (8, 16, 32, 64):
        limit = 1.5 * np.sqrt(last * 0.5) / 0.5
        for over, is_told in ((0.99, False), (1.01, True)):
            ratio = np.ones(65)
            ratio[last] += over * limit
            # What stands beyond an octave's last bin takes away what longer ones would see.
            ratio[last + 1 :] -= 1.0
            assert slow_drift.is_slow(ratio, 1000, 2000) is is_told
    assert not slow_drift.is_slow(np.array([9.0, 9.0]), 1000, 2000)


def test_twice_whittles_likelihood_costs_its_numbers() -> None:
    spectrum, power = np.array([1.0, 2.0, 4.0]), np.array([2.0, 2.0, 2.0])
    known = -10.0 * np.mean([2.0, np.log(2.0) + 1.0, np.log(4.0) + 0.5]) - 3.0 * np.log(10.0)
    found = slow_drift._criterion(slow_drift.whittle(spectrum, power, 10), 3, 10)
    assert found == pytest.approx(known)


class Level:
    """White noise of the mean of a power."""

    def __init__(self, power: Array) -> None:
        self.weights = np.zeros(0)
        self.level = np.full(power.shape, np.mean(power))

    def spectrum(self) -> Array:
        """At every bin."""
        return self.level


def test_rounds_part_a_drift_from_white_noise() -> None:
    for length in (100, 101):
        power = 1.0 + Drift(2.0, 0.1).spectrum(length)
        begun = Level(power), Drift(1.0, 0.1)
        fast, drift = parted(Level, power, length, begun, 1)
        own = begun[1].spectrum(length)
        share = own / (own + begun[0].level)
        slow = share**2 * power + share * begun[0].level
        assert drift.variance == pytest.approx(whole(slow, length).sum() / length)
        rest = (1.0 - share) ** 2 * power + share * begun[0].level
        assert fast.level[0] == pytest.approx(np.mean(rest))
        fast, drift = parted(Level, power, length, begun, 2000)
        assert (fast.level[0], drift.variance) == (
            pytest.approx(1.0, rel=3e-3),
            pytest.approx(2.0, rel=3e-3),
        )
    # Rounds end where a variance changes by less than 1e-7.
    calls: list[int] = []

    def fitted(_: Array) -> Level:
        calls.append(1)
        return Level(np.ones(501))

    # The lag that wraps around is 0.9^1000: the first round finds what it began with.
    power = 1.0 + Drift(1.0, 0.1).spectrum(1000)
    for variance in (1.0, 1.0 + 1e-4):
        rounds, before, after = 0, 0.0, variance
        while abs(after - before) > 1e-7 * before:
            own = Drift(after, 0.1).spectrum(1000)
            slow = (own / (own + 1.0)) ** 2 * power + own / (own + 1.0)
            before, after, rounds = after, whole(slow, 1000).sum() / 1000, rounds + 1
        calls.clear()
        pair: Any = (Level(np.ones(501)), Drift(variance, 0.1))
        parted(fitted, power, 1000, pair, 50)
        assert len(calls) == rounds


def test_corners_are_tried_a_factor_apart_and_the_likeliest_stays() -> None:
    n, length = 6000, 12_000
    power = 1.0 + Drift(5.0, 0.008).spectrum(length)
    tried: list[tuple[int, float, float]] = []

    def rounds(_: Array, pair: Any, count: int) -> Any:
        _, drift = pair
        tried.append((count, drift.corner, drift.variance))
        known: Any = SimpleNamespace(weights=np.zeros(0), spectrum=lambda: np.ones(length // 2 + 1))
        # Two neighbours end alike, and are looked at longer; the others are far behind.
        corner = 0.008 if 0.003 < drift.corner < 0.02 else drift.corner
        return known, Drift(5.0 if count > 4 else 4.9, corner)

    _, drift = slow_drift.apart(Level(power), power, n, length, rounds)
    corners = np.geomspace(1.5 / n, 0.05, 1 + round(np.log(0.05 * n / 1.5) / np.log(4.0)))
    looked = [each for each in tried if each[0] == 4]
    near = int(np.sum((corners > 0.003) & (corners < 0.02)))
    assert [each[1] for each in looked] == pytest.approx(corners)
    assert [each[2] for each in looked] == pytest.approx([0.3 * np.mean(power)] * len(corners))
    assert drift is not None
    assert drift.corner == 0.008
    assert [count for count, *_ in tried[len(corners) :]] == [6] * near + [30]
    assert near > 1
    plain = Level(np.ones(length // 2 + 1))
    assert slow_drift.apart(plain, plain.level, n, length, rounds) == (plain, None)


def test_an_autoregression_continues_its_lags_and_has_their_spectrum() -> None:
    """Of order two: x(t) = 1.2 x(t - 1) - 0.5 x(t - 2) + e(t), e of variance two."""
    weights, length = np.array([1.2, -0.5]), 64
    angles = 2.0 * np.pi * np.arange(4097) / 8192.0
    spectrum = 2.0 / np.abs(1.0 - 1.2 * np.exp(-1j * angles) + 0.5 * np.exp(-2j * angles)) ** 2
    lags = scipy.fft.irfft(spectrum, 8192)
    model = Autoregression(lags[:6], weights, 500, length)
    assert (model.is_white, model.order) == (False, 2)
    for count in (1, 2, 3, 9):
        assert model.autocovariance(count) == pytest.approx(lags[:count])
    assert model.spectrum() == pytest.approx(spectrum[:: 8192 // 64])
    columns = np.random.default_rng(3).standard_normal((30, 2))
    among = scipy.linalg.toeplitz(lags[:30])
    assert model.squared(columns) == pytest.approx(columns.T @ among @ columns)
    drift = Drift(0.7, 0.02)
    both = Autoregression(lags[:6], weights, 500, length, drift)
    assert (both.is_white, both.order) == (False, 3)
    among = among + scipy.linalg.toeplitz(drift.autocovariance(30))
    assert both.squared(columns) == pytest.approx(columns.T @ among @ columns)
    assert both.autocovariance(9) == pytest.approx(lags[:9] + drift.autocovariance(9))
    assert both.spectrum() == pytest.approx(model.spectrum() + drift.spectrum(length))
    white = Autoregression(np.array([2.0, 0.1]), np.zeros(0), 500, length)
    assert (white.is_white, white.order) == (True, 0)
    assert white.autocovariance(3).tolist() == [2.0, 0.0, 0.0]
    assert white.spectrum() == pytest.approx(2.0)
    assert white.squared(columns) == pytest.approx(2.0 * columns.T @ columns)


def test_levels_are_known_by_as_many_samples_as_their_weights_leave() -> None:
    """At zero frequency the level is e / (1 - Σ a)²: by differences over e and the weights."""
    white = Autoregression(np.array([2.0]), np.zeros(0), 500, 64)
    assert white.freedom() == pytest.approx(500.0)
    weights, e = np.array([0.9, -0.3]), 2.0
    rho = 0.9 / 1.3
    variance = e / (1.0 - 0.9 * rho + 0.3 * (0.9 * rho - 0.3))
    lags = variance * np.array([1.0, rho, 0.9 * rho - 0.3])
    model = Autoregression(lags, weights, 500, 64)
    known = np.linalg.inv(scipy.linalg.toeplitz(lags[:2])) * e / 500.0
    slopes = 2.0 / (1.0 - weights.sum()) * np.ones(2)
    assert model.freedom() == pytest.approx(2.0 / (2.0 / 500.0 + slopes @ known @ slopes))
    drift = Drift(3.0, 0.05)
    both = Autoregression(lags, weights, 500, 64, drift)
    fast, slow = model.spectrum(), drift.spectrum(64)
    at = 5
    share = (fast / (fast + slow)) ** 2 * (2.0 / model.freedom()) + drift.doubt(fast, 500, 64)
    found = both.freedom(np.array([(fast + slow)[at] * 1.0000001, (fast + slow)[0] + 1.0]))
    assert found == pytest.approx([2.0 / share[at], max(2.0 / share[0], 1.0)])
    assert both.freedom() == model.freedom()
    few = Autoregression(lags, np.array([0.99, 0.0]), 2, 64)
    assert few.freedom() == 1.0
    assert Autoregression(lags, np.array([1.0, 0.0]), 500, 64).freedom() == 1.0
    assert Autoregression(np.ones(3), weights, 500, 64).freedom() == 1.0


def test_columns_are_unshaped_by_a_spectrum_without_deep_valleys() -> None:
    lags, weights = np.array([1.0, 0.5, 0.25]), np.array([0.5])
    model = Autoregression(lags, weights, 20, 40)
    columns = np.random.default_rng(5).standard_normal((20, 2))
    spectrum = model.spectrum()
    deep = Autoregression(np.array([1.0, 0.98, 0.9604]), np.array([0.98]), 20, 40)
    for each, level in (
        (model, spectrum),
        (deep, np.maximum(deep.spectrum(), 0.02 * np.mean(deep.spectrum()))),
    ):
        parts = scipy.fft.rfft(columns, 40, axis=0) / level[:, None]
        assert each.unshaped(columns) == pytest.approx(scipy.fft.irfft(parts, 40, axis=0)[:20])
    assert np.any(deep.spectrum() < 0.02 * np.mean(deep.spectrum()))


def test_orders_are_those_that_samples_allow_and_negative_power_is_cut() -> None:
    for n, count in ((399, 20), (400, 21), (4000, 21), (19, 1)):
        assert residual_noise._fitted(np.ones(4001), n, 8000).lags.size == count
    power = np.ones(401)
    power[100:120] = -3.0
    found = residual_noise._fitted(power, 400, 800)
    cut = np.maximum(power, 1e-6 * np.mean(np.maximum(power, 0.0)))
    sound = residual_noise._fitted(np.where(power < 0.0, -40.0, power), 400, 800)
    assert sound.lags == pytest.approx(periodograms.first_lags(cut, 800, 20), rel=1e-12)
    assert np.all(found.spectrum() > 0.0)


def test_noise_is_white_without_weights_and_without_slow_power() -> None:
    n, length = 1000, 2048
    flat, high = np.ones(60), np.full(60, 9.0)
    white, red = np.array([1.0, *[0.0] * 20]), 0.7 ** np.arange(21)
    table = ((white, flat, True), (white, high, False), (red, flat, False), (red, high, False))
    for lags, slow, is_white in table:
        found = residual_noise._white(lags, slow, n, length)
        assert (found is not None) is is_white
