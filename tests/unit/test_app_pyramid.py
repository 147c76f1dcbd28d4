"""Long channels at any zoom: nothing that a column holds is lost, and what is missing stays so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("fastapi", reason="the extra app is not installed")

from flightid.app.pyramid import BASE, Pyramid, view


@given(st.integers(0, 2**32 - 1), st.integers(200, 60_000), st.integers(10, 60))
def test_every_column_shows_its_extremes(seed: int, n: int, n_columns: int) -> None:
    random = np.random.default_rng(seed)
    time_s = np.cumsum(random.uniform(0.5, 1.5, n))
    values = random.standard_normal(n)
    values[random.integers(0, n, 3)] = 50.0, -50.0, 70.0
    made = Pyramid.of(time_s, values)
    table = view([made], (time_s[0], time_s[-1]), n_columns)
    shown = table[1][np.isfinite(table[1])]
    # Whatever the zoom, no peak is lost, none is invented, and none is drawn a column away.
    assert (shown.max(), shown.min()) == (values.max(), values.min())
    assert set(shown) <= set(values)
    width = (time_s[-1] - time_s[0]) / n_columns
    place = table[0][np.nanargmax(np.where(np.isfinite(table[1]), table[1], -np.inf))]
    assert abs(place - time_s[values.argmax()]) <= 1.3 * width


def test_a_spike_of_one_sample_among_two_million_shows() -> None:
    n = 2_000_000
    values = np.zeros(n)
    values[1_234_567] = 1.0
    table = view([Pyramid.of(np.arange(n) * 1e-3, values)], (0.0, n * 1e-3), 800)
    assert np.nanmax(np.where(np.isfinite(table[1]), table[1], 0.0)) == 1.0
    assert table[0][np.argmax(table[1] == 1.0)] == pytest.approx(1234.567, abs=n * 1e-3 / 800)


def test_gaps_and_missing_values_break_the_line_at_every_zoom() -> None:
    for n in (100, 100_000):
        _breaks(n)


def _breaks(n: int) -> None:
    time_s = np.arange(n) * 0.01
    time_s[n // 2 :] += 0.2 * n * 0.01  # a silence of a fifth of the record
    values = np.ones(n)
    values[n // 4] = np.nan
    infinite = values.copy()
    infinite[n // 4] = np.inf
    for row in (values, infinite):
        table = view([Pyramid.of(time_s, row)], (0.0, time_s[-1]), 200)
        broken = table[0][np.isnan(table[1])]
        missing = np.abs(broken - time_s[n // 4]) < 0.02 * time_s[-1]
        silent = (broken > 0.99 * time_s[n // 2 - 1]) & (broken < 1.01 * time_s[n // 2])
        assert missing.any()
        assert silent.any()
        assert np.all(missing | silent)


def test_series_of_other_stamps_share_one_axis_of_time() -> None:
    fast = Pyramid.of(np.arange(5.0), np.arange(5.0))
    slow = Pyramid.of(np.array([0.5, 3.5]), np.array([10.0, 20.0]))
    table = view([fast, slow], (0.0, 4.0), 100)
    assert table[0].tolist() == [0.0, 0.5, 1.0, 2.0, 3.0, 3.5, 4.0]
    assert table[1][[0, 2, 3, 4, 6]].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert np.isinf(table[1][[1, 5]]).all()
    assert table[2][[1, 5]].tolist() == [10.0, 20.0]


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    stamps = random.permutation(np.arange(10.0 * BASE))  # disordered, and one is no number
    stamps[5] = np.nan
    made = Pyramid.of(stamps, random.standard_normal(stamps.size))
    assert np.all(np.diff(made.time_s) > 0.0)
    read = Pyramid.read(made.write(tmp_path / "channel.npy"))
    for mine, theirs in zip(
        (made.time_s, made.values, made.breaks, *made.levels),
        (read.time_s, read.values, read.breaks, *read.levels),
        strict=True,
    ):
        np.testing.assert_array_equal(mine, theirs)
