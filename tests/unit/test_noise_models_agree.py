"""Models of noise by tables, spans and whole transforms, in other units and backwards in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from flightid.uncertainty import residual_noise
from flightid.uncertainty.fitted_directions import FittedDirections
from flightid.uncertainty.periodograms import (
    LONGEST_TABLE,
    first_lags,
    leaking,
    periodogram,
    pooled,
    transform_length,
    twice,
)
from flightid.uncertainty.residual_noise import Autoregression, noise_models
from tests.closeness import assert_close


def test_lags_are_those_of_the_whole_transform_whichever_way() -> None:
    for length in (8, 9, 400, 405, 40_000, 39_375, 65_536):
        power = np.random.default_rng(length).random(length // 2 + 1) + 0.1
        largest = min(20, length // 2)
        full = np.concatenate([power, power[1 : (length + 1) // 2][::-1]])
        assert full.size == length
        angle = 2.0 * np.pi * np.outer(np.arange(largest + 1), np.arange(length)) / length
        wanted = np.cos(angle) @ full / length
        for often in (False, True):
            found = first_lags(power, length, largest, often=often)
            assert_close(found, wanted, atol=1e-9 * wanted[0], why="spans of a whole transform")
        if length > LONGEST_TABLE:
            more = first_lags(power, length, 21)
            assert_close(more[: largest + 1], wanted, atol=1e-11 * wanted[0], why="a transform")
        assert twice(length).sum() == length


def test_periodograms_are_means_over_columns_and_records() -> None:
    random = np.random.default_rng(0)
    one, two = random.standard_normal((30, 2)), random.standard_normal((50, 2))
    assert transform_length(50) == 100
    for each in (one, two):
        whole = np.abs(np.fft.rfft(each, 100, axis=0)) ** 2 / len(each)
        assert_close(periodogram(each, 100), whole.mean(axis=1), rtol=1e-12, why="definition")
    assert_close(periodogram(two), periodogram(two, 100), rtol=1e-12, why="room for all lags")
    wanted = (30 * periodogram(one, 100) + 50 * periodogram(two, 100)) / 80
    assert_close(pooled([one, two], 100), wanted, rtol=1e-12, why="by samples")


def test_a_spectrum_leaks_by_the_lags_that_records_see() -> None:
    lags = 0.9 ** np.arange(51)
    spectrum = np.fft.rfft(np.concatenate([lags, lags[1:50][::-1]])).real
    k = np.arange(50)
    seen = (np.maximum(30 - k, 0) + np.maximum(50 - k, 0)) / 80
    omega = 2.0 * np.pi * np.arange(51) / 100
    wanted = lags[0] + 2.0 * np.cos(np.outer(omega, k[1:])) @ (lags[1:50] * seen[1:])
    assert_close(leaking(spectrum, [30, 50], 100), wanted, rtol=1e-9, why="definition")


def _model(residuals: list[np.ndarray]) -> Autoregression:
    none = [FittedDirections(*[np.zeros((1, each.size, 0))] * 2) for each in residuals]
    (model,) = noise_models([each[None] for each in residuals], none)
    return model


def _alike(found: Autoregression, plain: Autoregression, factor: float, within: float) -> None:
    assert_close(found.weights, plain.weights, rtol=within, atol=within, why="of no unit")
    size = factor**2 * plain.lags[0]
    assert_close(found.lags / size, plain.lags / plain.lags[0], atol=within, why="a square")
    assert (found.drift is None) is (plain.drift is None)
    if found.drift is not None and plain.drift is not None:
        assert found.drift.corner == plain.drift.corner
        told = found.drift.variance / factor**2
        assert_close(told, plain.drift.variance, rtol=within, why="a square")


@pytest.mark.parametrize("slow", [0.0, 0.08])
def test_a_model_of_noise_knows_neither_units_nor_which_way_time_runs(
    monkeypatch: pytest.MonkeyPatch, slow: float
) -> None:
    random = np.random.default_rng(7)
    made = []
    for n in (1500, 1200):
        quick = random.standard_normal(n)
        quick = quick if slow else lfilter([1.0], [1.0, -0.6, 0.2], quick)
        made.append(quick + slow * lfilter([1.0], [1.0, -0.99], random.standard_normal(n)))
    plain = _model(made)
    assert plain.order > 0
    assert (plain.drift is not None) is (slow > 0.0)
    _alike(_model([16.0 * each for each in made]), plain, 16.0, 1e-9)
    _alike(_model([each[::-1] for each in made]), plain, 1.0, 1e-6)
    _alike(_model(made[::-1]), plain, 1.0, 1e-6)
    # Long transforms are without tables, and tell the same.
    monkeypatch.setattr(residual_noise, "LONGEST_TABLE", 0)
    _alike(_model(made), plain, 1.0, 1e-5)
