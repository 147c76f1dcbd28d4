"""The periodic estimator: exact at harmonics, its transient taken out, its errors counted."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import DataError
from tests.closeness import assert_close

STEP_S, PERIOD = 0.05, 200
NUMERATOR, DENOMINATOR = [0.0, 0.3], [1.0, -1.7, 0.8]


def multisine(periods: int, seed: int = 0) -> NDArray[np.float64]:
    random = np.random.default_rng(seed)
    k = np.arange(1, 21)[:, None]
    phase = random.uniform(0.0, 2.0 * np.pi, (20, 1))
    one = np.cos(2.0 * np.pi * k * np.arange(PERIOD) / PERIOD + phase).sum(axis=0)
    return np.tile(one, periods)


def record(periods: int, noise: float, seed: int = 0, *, settled: int = 20) -> fid.Record:
    long = multisine(periods + settled)
    y = lfilter(NUMERATOR, DENOMINATOR, long)[settled * PERIOD :]
    n = len(y)
    y = y + noise * np.random.default_rng(seed).standard_normal(n)
    return fid.Record.from_arrays(
        STEP_S * np.arange(n),
        inputs={"u": long[:n]},
        outputs={"y": y},
        period_s=STEP_S * PERIOD,
    )


def truth(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    z = np.exp(-1j * omega * STEP_S)
    return np.polyval(NUMERATOR[::-1], z) / np.polyval(DENOMINATOR[::-1], z)


def estimated(given: fid.Record, **options: object) -> fid.FrequencyResponse:
    return fid.estimate_response(given, estimator="periodic", band_rad_s=(1.5, 12.0), **options)


def test_exact_in_the_steady_state() -> None:
    found = estimated(record(3, 0.0))
    harmonics = found.omega_rad_s * STEP_S * PERIOD / (2.0 * np.pi)
    assert_close(harmonics, np.round(harmonics), atol=1e-9, why="harmonics alone")
    assert_close(found.response[0, 0], truth(found.omega_rad_s), rtol=1e-9, why="whole periods")


def test_a_transient_is_taken_out_where_plain_division_keeps_it() -> None:
    given = record(4, 0.0, settled=0)
    found = estimated(given)
    bins = np.fft.rfft([given["u"], given["y"]], axis=1)
    places = np.round(found.omega_rad_s * 4 * STEP_S * PERIOD / (2.0 * np.pi)).astype(int)
    plain = bins[1, places] / bins[0, places]
    exact = truth(found.omega_rad_s)
    rough = np.max(np.abs(plain / exact - 1.0))
    assert rough > 1e-3
    assert np.max(np.abs(found.response[0, 0] / exact - 1.0)) < 0.1 * rough


@pytest.mark.parametrize(
    ("flights", "near"), [(30, 0.2), pytest.param(150, 0.1, marks=pytest.mark.nightly)]
)
def test_errors_are_those_of_repeated_flights(flights: int, near: float) -> None:
    found = [estimated(record(4, 0.5, seed)) for seed in range(flights)]
    exact = truth(found[0].omega_rad_s)
    errors = np.array([each.response[0, 0] - exact for each in found])
    claimed = np.mean([np.diag(each.covariance[0]) for each in found], axis=0)
    n = len(exact)
    ratio = np.var(errors, axis=0) / (claimed[:n] + claimed[n:])
    assert abs(np.mean(ratio) - 1.0) < near
    assert np.all((ratio > 1.0 - 4.0 * near) & (ratio < 1.0 + 5.0 * near))


def test_refusals() -> None:
    given = record(3, 0.0)
    bare = fid.Record.from_arrays(given.time_s, inputs={"u": given["u"]}, outputs={"y": given["y"]})
    with pytest.raises(DataError, match="no common period"):
        estimated(bare)
    with pytest.raises(DataError, match="fewer than two whole periods"):
        estimated(record(1, 0.0))
    with pytest.raises(DataError, match="no whole number of samples"):
        estimated(bare.declare(period_s=STEP_S * (PERIOD + 0.5)))
    twice = fid.Record.from_arrays(
        given.time_s,
        inputs={"u": given["u"], "v": 2.0 * given["u"]},
        outputs={"y": given["y"]},
        period_s=STEP_S * PERIOD,
    )
    with pytest.raises(DataError, match="cannot be told apart"):
        estimated(twice)


def test_inputs_that_repeat_choose_it_by_themselves() -> None:
    given = record(5, 0.05)
    found = fid.estimate_response(given, band_rad_s=(1.0, 12.0))
    told = fid.estimate_response(given, band_rad_s=(1.0, 12.0), estimator="periodic")
    assert found.estimator == "periodic"
    assert_close(found.response, told.response, rtol=1e-12, why="the same estimate")
    (said,) = [each.message for each in found.findings if each.code == "periodic"]
    assert "repeat every 10 s" in said
    assert "left out" not in said


@pytest.mark.parametrize(
    ("given", "options"),
    [
        (record(2, 0.05), {}),
        (record(5, 0.05).replace({"u": multisine(5) + 1e-3 * np.arange(1000)}), {}),
        (record(5, 0.05), {"window_s": 20.0}),
        (record(5, 0.05), {"omega_rad_s": [1.0, 2.0, 3.0]}),
    ],
)
def test_windows_are_kept_where_nothing_repeats_or_they_are_asked_for(
    given: fid.Record, options: dict[str, object]
) -> None:
    band = {} if "omega_rad_s" in options else {"band_rad_s": (1.0, 12.0)}
    assert fid.estimate_response(given, **band, **options).estimator == "composite"


def _started(periods: int, decay: float) -> fid.Record:
    given = record(periods, 0.05)
    start = 30.0 * decay ** np.arange(periods * PERIOD)
    return given.replace({"y": given["y"] + start})


def test_periods_of_a_start_are_left_out() -> None:
    found = fid.estimate_response(_started(6, 0.98), band_rad_s=(1.0, 12.0))
    (said,) = [each.message for each in found.findings if each.code == "periodic"]
    assert "4 whole periods; 2 before them left out" in said
    assert found.linear is not None
    assert found.linear.output_records[0].shape[1] == 4 * PERIOD


def test_a_start_that_outlasts_the_periods_is_said_or_left_to_windows() -> None:
    given = _started(4, 0.995)
    assert fid.estimate_response(given, band_rad_s=(1.0, 12.0)).estimator == "composite"
    (said,) = [each for each in estimated(given).findings if each.code == "periods-unsettled"]
    assert said.light.value == "amber"
