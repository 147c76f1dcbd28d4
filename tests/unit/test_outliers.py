"""Outliers are bridged, and what is none stays to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.conditioning import remove_outliers
from flightid.errors import DataError, OptionError, UnknownNameError
from tests.closeness import assert_close

TIME_S = np.arange(2000) * 0.01


def _record(y: np.ndarray) -> fid.Record:
    steps = np.sign(np.sin(TIME_S))
    return fid.Record.from_arrays(TIME_S, inputs={"u": steps}, outputs={"y": y})


def test_spikes_in_noise_are_bridged_and_counted() -> None:
    clean = np.sin(2 * TIME_S) + 0.05 * np.random.default_rng(3).standard_normal(TIME_S.size)
    spoilt = clean.copy()
    spoilt[[100, 101, 700, 1500]] += [3.0, 3.0, -4.0, 50.0]
    cleaned = remove_outliers(_record(spoilt))
    assert_close(
        cleaned["y"][[100, 101, 700, 1500]],
        clean[[100, 101, 700, 1500]],
        atol=0.25,
        why="a line between neighbours with 0.05 of noise, and the curve's own bend",
    )
    others = np.delete(np.arange(TIME_S.size), [100, 101, 700, 1500])
    assert np.mean(cleaned["y"][others] == clean[others]) > 0.99
    assert cleaned.history[-1].options["y"] < 20


def test_a_clean_curve_and_stepping_inputs_stay_as_they_are() -> None:
    record = _record(np.sin(2 * TIME_S))
    cleaned = remove_outliers(record, deviations=20.0)
    assert np.array_equal(cleaned["y"], record["y"])
    assert np.array_equal(cleaned["u"], record["u"])


def test_a_quiet_channel_with_one_spike_is_mended() -> None:
    still = np.zeros(TIME_S.size)
    still[::7] = 0.001
    still[55] = 5.0
    assert remove_outliers(_record(still))["y"][55] < 0.01


def test_refusals() -> None:
    record = _record(np.sin(TIME_S))
    with pytest.raises(OptionError, match="deviations is not positive"):
        remove_outliers(record, deviations=0.0)
    with pytest.raises(OptionError, match="half_width does not suit"):
        remove_outliers(record, half_width=0)
    with pytest.raises(UnknownNameError):
        remove_outliers(record, channels=["z"])
    spiky = np.where(np.arange(TIME_S.size) % 8 == 0, 100.0, 0.0)
    spiky += 1e-3 * np.random.default_rng(0).standard_normal(TIME_S.size)
    with pytest.raises(DataError, match="too many samples"):
        remove_outliers(_record(spiky))
