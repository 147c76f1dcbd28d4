"""What a fit takes of white noise, against the covariance of what it leaves, written out."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.output_error import N, two_rates, two_rates_record
from numpy.typing import NDArray
from scipy.signal import lfilter

import flightid as fid
from flightid._native import lags_of_form
from flightid.identification.output_error import distinct
from flightid.identification.output_error.distinct import run_with_slopes
from flightid.identification.records.options import RecordOptions
from flightid.identification.records.setup import prepare_records
from flightid.uncertainty import residual_noise, taken_noise
from flightid.uncertainty.fitted_directions import (
    FittedDirections,
    slow_transforms,
)
from flightid.uncertainty.residual_noise import Autoregression, noise_models
from flightid.uncertainty.taken_noise import TakenNoise
from flightid.uncertainty.transformed_columns import transforms
from tests.closeness import assert_close

Array = NDArray[np.float64]
SEED = 8
"""Of noise without slow power, by chance."""


def _directions(lengths: tuple[int, ...], n_outputs: int, m: int, k: int) -> list[FittedDirections]:
    """Orthonormal over all records, own ones within each."""
    random = np.random.default_rng(5)
    own, shared = [], []
    for n in lengths:
        rows = np.cumsum(random.standard_normal((n_outputs * n, m + k)), axis=0)
        basis = np.linalg.qr(rows[:, :m])[0] if m else rows[:, :0]
        own.append(basis.reshape(n_outputs, n, m))
        shared.append(rows[:, m:] - basis @ (basis.T @ rows[:, m:]))
    ends = np.cumsum([len(each) for each in shared])[:-1]
    parts = np.split(np.linalg.qr(np.vstack(shared))[0], ends)
    return [
        FittedDirections(each, part.reshape(n_outputs, -1, k))
        for each, part in zip(own, parts, strict=True)
    ]


def test_lags_reach_beyond_rows_that_are_turned_together() -> None:
    random = np.random.default_rng(2)
    form = random.standard_normal((3, 3))
    form = form + form.T
    for n in (1, 7, 511, 512, 513, 520, 1100):
        columns = random.standard_normal((n, 3))
        among = columns @ form @ columns.T
        for n_lags, own in ((1, 0), (2, 2), (6, 3)):
            found = lags_of_form(columns[:, :own], columns[:, own:], form, n_lags)
            wanted = [np.trace(among, offset=lag) for lag in range(n_lags)]
            assert_close(found, wanted, atol=1e-10, why="the sum written out")


def test_lags_and_power_are_those_of_the_covariance_that_is_left() -> None:
    lengths, n_outputs, m, k, n_lags, length = (40, 23), 2, 2, 3, 6, 128
    taken, levels = _directions(lengths, n_outputs, m, k), np.array([2.0, 0.3])
    whole = np.concatenate(
        [np.zeros((n_outputs * sum(lengths), m * len(lengths))), np.zeros((126, k))], axis=1
    )
    places, begin = [], 0
    for r, (n, each) in enumerate(zip(lengths, taken, strict=True)):
        rows = slice(begin, begin + n_outputs * n)
        whole[rows, r * m : (r + 1) * m] = each.own.reshape(-1, m)
        whole[rows, m * len(lengths) :] = each.shared.reshape(-1, k)
        places += [[(begin + o * n, n) for o in range(n_outputs)]]
        begin += n_outputs * n
    noise = np.diag(np.concatenate([np.repeat(levels, n) for n in lengths]))
    left = np.eye(len(whole)) - whole @ whole.T
    lost = noise - left @ noise @ left
    lags, power = np.zeros((n_outputs, n_lags)), np.zeros((n_outputs, 9))
    for record in places:
        for o, (first, n) in enumerate(record):
            block = lost[first : first + n, first : first + n]
            lags[o] += [np.trace(block, offset=lag) for lag in range(n_lags)]
            waves = np.exp(-2j * np.pi * np.outer(np.arange(9), np.arange(n)) / length)
            power[o] += np.einsum("bt,ts,bs->b", waves, block, waves.conj()).real
    noise = TakenNoise(taken, length, n_lags, 9)
    models = [Autoregression(np.array([level]), np.empty(0), 63, length) for level in levels]
    forms = noise.forms(models)
    for o, (level, model) in enumerate(zip(levels, models, strict=True)):
        found = noise.of_white(o, level, forms)
        assert_close(found[0], lags[o], atol=1e-12, why="rounding")
        assert_close(found[1], power[o], atol=1e-11, why="rounding of sums of 40 samples")
        whole = noise.at_all_bins(o, model, forms)
        assert_close(whole[:9], power[o], atol=1e-11, why="rounding of sums of 40 samples")


@pytest.mark.parametrize("n", [1, 700, 120_001])
def test_slow_bins_are_those_of_the_whole_transform(n: int) -> None:
    columns = np.random.default_rng(n).standard_normal((n, 2))
    length = 2 * n + 130
    whole = np.fft.rfft(columns, length, axis=0)[:65]
    found = slow_transforms(columns, length, 65)
    assert_close(found, whole, atol=1e-11 * np.sqrt(n), why="terms of the series that are left out")


@pytest.mark.parametrize("coloured", [False, True])
def test_white_noise_has_the_models_that_all_transforms_give(
    monkeypatch: pytest.MonkeyPatch, coloured: bool
) -> None:
    """Also beside an output with colour: of white ones no transform is asked for."""
    taken, random = _directions((900, 2500), 3, 2, 4), np.random.default_rng(SEED)
    residuals = [random.standard_normal((3, n)) for n in (900, 2500)]
    if coloured:
        for each in residuals:
            each[1] = lfilter([1.0], [1.0, -0.8], each[1])
    asked: list[int] = []

    def counted(columns: Array, length: int) -> Array:
        asked.append(len(columns))
        return transforms(columns, length)

    with monkeypatch.context() as patch:
        patch.setattr(taken_noise, "transforms", counted)
        found = noise_models(residuals, taken)
    assert sorted(asked) == ([900, 2500] if coloured else [])
    with monkeypatch.context() as patch:
        patch.setattr(residual_noise, "_white", lambda *_: None)
        expected = noise_models(residuals, taken)
    for o, (one, other) in enumerate(zip(found, expected, strict=True)):
        assert one.is_white == other.is_white == (not coloured or o != 1)
        assert_close(one.lags, other.lags, rtol=1e-12, atol=1e-13, why="rounding of two ways")


def test_a_record_is_fitted_in_less_than_five_times_its_sensitivities() -> None:
    def fit(seed: int) -> None:
        fid.identify(two_rates(), two_rates_record(seed), initial_state="trim", output_bias=False)

    fit(2)  # what a process loads with its first fit is no part of it
    tracemalloc.start()
    try:
        fit(1)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 5.0 * 8 * 2 * 8 * N  # bytes, outputs, parameters; 8 times with whole copies


def test_beginnings_of_long_records_tell_numbers_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    lengths: list[int] = []

    def counted(model, prepared, *rest):
        lengths.append(prepared.arrays[0][1].shape[1])
        return run_with_slopes(model, prepared, *rest)

    monkeypatch.setattr(distinct, "run_with_slopes", counted)
    prepared = prepare_records(two_rates(), two_rates_record(3), RecordOptions())
    distinct.require_distinct(prepared.model, prepared, None)
    assert lengths == [distinct.BEGINNING]
    # Inputs that stand still at first tell nothing there: the whole record is asked.
    still = [(np.where(np.arange(u.shape[1]) < 3000, 0.0, u), y, step)
             for u, y, step in prepared.arrays]  # fmt: skip
    distinct.require_distinct(prepared.model, replace(prepared, arrays=still), None)
    assert lengths[1:] == [distinct.BEGINNING, N]
