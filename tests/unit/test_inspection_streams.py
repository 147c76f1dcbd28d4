"""Rates, stamps, skew and growth, at both sides of every limit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flightid.inspection import (
    divergence,
    gap_findings,
    rates,
    skew,
    stamps,
)
from flightid.inspection.signals import Signal
from tests.handmade_log import HandmadeLog


def test_a_stream_has_rate_jitter_and_gaps() -> None:
    """Nineteen steps: fifteen of 10 ms, two of 11 ms, two of 40 ms, and a stamp that goes back."""
    steps = np.array([10] * 8 + [40] + [10] * 4 + [11] * 2 + [10] * 3 + [30]) * 1e-3
    times = np.concatenate([[5.0], 5.0 + np.cumsum(steps)])
    times = np.insert(times, 12, 5.001)
    found = rates._of("X", 1, times)
    assert found is not None
    assert (found.message, found.instance, found.rows, found.n_disordered) == ("X", 1, 21, 1)
    assert found.rate_hz == pytest.approx(100.0)
    assert found.mean_hz == pytest.approx(19 / steps.sum())
    low, high = np.percentile(steps, [5, 95])
    assert found.jitter == pytest.approx((high - low) / 0.02)
    assert (found.n_gaps, found.longest_gap_s) == (2, pytest.approx(0.04))
    even = rates._of("X", None, np.arange(10.0))
    assert even is not None
    assert (even.n_gaps, even.longest_gap_s, even.jitter, even.mean_hz) == (0, 0.0, 0.0, 1.0)
    assert rates._of("X", None, np.arange(9.0)) is None
    assert rates._of("X", None, np.array([*range(9), 3.0])) is None
    assert rates.stream_gaps(np.array([0.0, 1.0, 2.0, 4.49, 5.49, 8.1])) == [(5.49, 8.1)]
    assert rates.stream_gaps(np.array([0.0, 1.0])) == []
    assert rates.stream_gaps(np.array([0.0])) == []


def test_bursts_and_rows_that_no_autopilot_samples() -> None:
    for rate, mean, jitter, is_burst in (
        (10_000.0, 9_999.0, 0.0, False),
        (10_001.0, 9_999.0, 0.0, True),
        (301.0, 100.0, 1.01, True),
        (299.0, 100.0, 1.01, False),
        (301.0, 100.0, 1.0, False),
    ):
        found = rates.StreamRate("X", 2, 99, rate, mean, jitter, 0, 0.0, 0)
        assert (found.is_burst, found.label) == (is_burst, "X[2]")
    assert rates.StreamRate("X", None, 99, 1.0, 1.0, 0.0, 0, 0.0, 0).label == "X"


def test_streams_are_told_the_fastest_first() -> None:
    log: Any = HandmadeLog("ardupilot").with_table("A", np.arange(20) * 0.1)
    log.with_table("B", np.arange(20) * 0.01).with_table("C", np.arange(20.0))
    log.with_table("D", np.arange(5.0))
    for info in log.messages.values():
        info.rate_hz, info.first_s = 1.0, 0.0
    log.messages["C"].first_s = None
    found = rates.stream_rates(log)
    assert [(each.message, each.instance) for each in found] == [("B", None), ("A", None)]


def test_stamps_within_a_fifth_of_the_middle_and_a_second_are_believed() -> None:
    # Of 1000 s between the first and the last hundredth: 201 s beside them.
    assert stamps._limits(100.0, 1100.0) == (-101.0, 1301.0)
    assert stamps._limits(0.0, 1e6) == (-200_001.0, 1_200_001.0)
    assert stamps._limits(0.0, 1e6 + 1.0) == (np.inf, -np.inf)
    steady = np.arange(1001.0)
    for last, is_all in ((1186.9, True), (1187.1, False)):
        # The middle 98 % end at stamps 10 and 990: 980 s, of which a fifth is 196 s.
        times = np.append(steady[:-1], last)
        assert stamps._are_all_believable(times) is is_all
        assert stamps.believable(times).tolist() == [True] * 1000 + [is_all]
        assert (stamps.believed(times) is times) is is_all
        first = np.concatenate([[1000.0 - last], steady[1:]])
        assert stamps._are_all_believable(first) is is_all
        assert stamps.believable(first)[0] == is_all
    assert stamps._are_all_believable(np.array([])) is False
    assert stamps._are_all_believable(np.array([1.0, 1.0])) is False
    assert stamps.believable(np.array([np.nan, np.nan])).tolist() == [False, False]
    assert stamps.believable(np.array([2.0])).tolist() == [True]
    mixed = np.array([1.0, 5.0, 2.0, 3.0, 4.0, np.nan, 6.0])
    assert stamps.believable(mixed).tolist() == [True, False, True, True, True, False, True]
    places = stamps._longest_increasing(np.array([3.0, 1.0, 2.0, 2.0, 5.0, 4.0]))
    assert np.count_nonzero(places) == 3


def test_the_span_of_a_log_is_that_of_its_longest_message() -> None:
    log: Any = HandmadeLog("px4").with_table("A", [1.0, 2.0, 9.0]).with_table("B", [4.0, 5.0])
    log.with_table("C", [0.0, 7.0, 8.0, 9.0])
    for name, count, rate in (("A", 3, 1.0), ("B", 2, 1.0), ("C", 4, None)):
        log.messages[name].rate_hz, log.messages[name].count = rate, count
    assert stamps.log_span(log) == (1.0, 9.0)
    log.messages["A"].count = 1
    assert stamps.log_span(log) == (4.0, 5.0)
    log.messages["B"].rate_hz = log.messages["A"].rate_hz = None
    assert stamps.log_span(log) == (0.0, 0.0)


def test_gaps_between_flights_without_arming_are_of_the_flight() -> None:
    air = ((0.0, 10.0), (20.0, 30.0))
    near = 1.0
    for gap, armed, is_flown in (
        ((9.0, 12.0), [], True),
        ((-2.0, 0.5), [], True),
        ((29.5, 40.0), [], True),
        ((30.0, 40.0), [], False),
        ((10.0, 20.0), [], True),
        ((10.0, 20.0), [15.0], False),
        ((10.0, 20.0), [10.0], False),
        ((10.0, 20.0), [20.0], False),
        ((10.0, 20.0), [9.9, 20.1], True),
        ((10.0 + near, 20.0 - near), [], True),
        ((10.1 + near, 20.0), [], False),
        ((10.0, 19.9 - near), [], False),
    ):
        assert gap_findings._in_flight(gap, air, armed) is is_flown, gap
    assert gap_findings._longest([(0.0, 1.0), (2.0, 5.0)]) == 3.0


def shifted(late: float, quiet: float = 0.0, n: int = 400) -> Any:
    """A smooth motion at 20 Hz and at 200 Hz, the second later."""
    rng = np.random.default_rng(1)
    fast_s = np.arange(0.0, n / 20.0 + 2.0, 0.005)
    motion = np.convolve(rng.standard_normal(fast_s.size + 80), np.hanning(81), "valid")
    slow_s = 1.0 + np.arange(n) / 20.0
    slow = np.interp(slow_s, fast_s, motion) + quiet * motion.std() * rng.standard_normal(n)
    first = Signal("p", slow_s, slow, "rad/s", "a")
    second = Signal("p", fast_s + late, motion, "rad/s", "b")
    return first, second


def test_how_late_a_stream_is_by_either_order() -> None:
    for late in (0.0123, -0.2):
        first, second = shifted(late)
        found = skew._skew("p", first, second, ((0.0, 99.0),))
        turned = skew._skew("p", second, first, ((0.0, 99.0),))
        assert found is not None
        assert turned is not None
        assert (found.lag_s, turned.lag_s) == (
            pytest.approx(late, abs=5e-5),
            pytest.approx(-late, abs=5e-5),
        )
        assert (found.first, found.second, turned.first) == ("a", "b", "b")
        assert found.resolution_s == pytest.approx(0.005)
        assert found.half_width_s < 1e-3
        assert found.correlation > 0.9999
        assert found.is_told
    first, second = shifted(0.31)
    assert skew._skew("p", first, second, ((0.0, 99.0),)) is None
    for noise, is_alike in ((0.45, True), (0.52, False)):
        found = skew._skew("p", *shifted(0.01, noise, 4000), ((0.0, 999.0),))
        assert (found is not None) is is_alike
    for n, is_known in ((50, True), (49, False)):
        first, second = shifted(0.01, n=n)
        assert (skew._skew("p", first, second, ((0.0, 99.0),)) is not None) is is_known
    still = Signal("p", first.time_s, 0.0 * first.values + 3.0, "rad/s", "a")
    assert skew._skew("p", still, second, ((0.0, 99.0),)) is None


def test_the_interval_of_a_lag_is_a_jackknife_over_ten_stretches() -> None:
    first, second = shifted(0.0, 0.2, 1000)
    found = skew._skew("p", first, second, ((0.0, 999.0),))
    assert found is not None
    step = 2.0 * 0.01 / 40.0
    moved_s = first.time_s + found.lag_s
    read = [np.interp(moved_s + s, second.time_s, second.values) for s in (0.0, step, -step)]
    read = [each - each.mean() for each in read]
    table = np.column_stack([read[0], (read[1] - read[2]) / (2.0 * step)])
    values = first.values - first.values.mean()
    lags = []
    for part in np.array_split(np.arange(1000), 10):
        kept = np.setdiff1d(np.arange(1000), part)
        gain, delay = np.linalg.lstsq(table[kept], values[kept], rcond=None)[0]
        lags.append(delay / gain)
    spread = np.sqrt(0.9 * np.sum((np.array(lags) - np.mean(lags)) ** 2))
    # Student's quantile of nine degrees of freedom.
    assert found.half_width_s == pytest.approx(2.262157 * spread, rel=1e-4)
    for lag, is_told, is_beyond in (
        (0.0101, True, False),
        (0.0099, False, False),
        (0.0141, True, True),
    ):
        each = skew.StreamSkew("p", "a", "b", -lag, 1.0, 0.001, 0.01)
        assert (each.is_told, each.exceeds(0.004)) == (is_told, is_beyond)
    coarse = skew.StreamSkew("p", "a", "b", 0.009, 1.0, 0.01, 0.0)
    assert (coarse.is_told, coarse.exceeds(0.004)) == (False, False)


def grown(
    rise: float = 1.4, windows: int = 9, held: int = 3, quiet: int = 12, late: float = 0.9
) -> divergence.Divergence | None:
    """Windows of 1 s, 50 samples each: quiet, growing by a factor each, then held."""
    envelope = np.concatenate(
        [np.ones(quiet), rise ** np.arange(1.0, windows + 1.0), np.full(held, late * rise**windows)]
    )
    time_s = 1.0 + 0.02 * np.arange(50 * envelope.size + 1)
    signs = np.where(np.arange(time_s.size) % 10 < 5, 1.0, -1.0)
    # Windows are counted from the end: the first sample is cut short.
    rows = np.concatenate([[0], np.repeat(np.arange(envelope.size), 50)])
    return divergence._grown(time_s, signs * envelope[rows], 1.0)


def test_growth_by_the_same_factor_over_six_windows_is_told() -> None:
    found = grown()
    assert found is not None
    assert found.time_constant_s == pytest.approx(1.0 / np.log(1.4), rel=0.02)
    assert found.frequency_hz == pytest.approx(5.0, rel=0.1)
    assert found.last == pytest.approx(1.4**8, rel=0.02)
    assert found.stop_s == pytest.approx(21.0, abs=0.03)
    assert found.at_limit_s == pytest.approx(4.0, abs=0.05)
    assert found.start_s == pytest.approx(12.0, abs=1.1)
    for either, is_told in (
        # Eightfold in 7 windows needs a factor of 1.35; below 1.05 is no growth, beyond 8 a jump.
        ({"windows": 7, "rise": 1.45}, True),
        ({"windows": 7, "rise": 1.30}, False),
        ({"windows": 5, "rise": 1.9}, False),
        ({"windows": 60, "rise": 1.06}, True),
        ({"windows": 60, "rise": 1.04}, False),
        ({"rise": 7.9}, True),
        ({"rise": 8.2}, False),
        ({"late": 0.26}, True),
        ({"late": 0.24}, False),
        ({"quiet": 0, "held": 0}, True),
    ):
        assert (grown(**either) is not None) is is_told, either


def test_growth_is_not_told_where_a_set_point_asks_for_it() -> None:
    found = divergence.Divergence(0.0, 9.0, 0.1, 1.0, 1.0, None, 0.0)
    time_s = np.arange(0.0, 12.0, 0.01)
    values = np.where(time_s < 6.0, 9.0, np.sin(time_s * 7.0))
    for share, is_unasked in ((0.49, True), (0.51, False)):
        asked = np.where(time_s < 6.0, -9.0, share * np.sin(time_s * 7.0))
        assert divergence._is_unasked(found, time_s, values, asked) is is_unasked
    assert divergence._is_unasked(found, time_s, values, None)
    signal = Signal("p", time_s, values, "rad/s", "x")
    for unit, last, is_told in (
        ("rad/s", 0.501, True),
        ("rad/s", 0.499, False),
        ("rad", 0.351, True),
        ("rad", 0.349, False),
    ):
        told = divergence.Divergence(0.0, 9.0, 0.1, last, 1.0, None, 0.0)
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(divergence, "divergence", lambda *_, told=told: told)
            named = Signal("p", time_s, values, unit, "x")
            assert (divergence._of_signal(named, None, (0.0, 9.0)) is not None) is is_told
            assert divergence._of_signal(named, None, (0.0, 0.225)) is None
            assert (divergence._of_signal(named, signal, (0.0, 0.235)) is not None) is is_told


def test_windows_of_growth_are_tried_by_half_octaves(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[float] = []
    monkeypatch.setattr(divergence, "_grown", lambda _t, _e, window: tried.append(window))
    for step, rows, first, last in (
        (0.01, 1001, 0.1, 1.25),
        (0.05, 2001, 0.2, 6.4),
        (0.01, 10_001, 0.1, 6.4),
    ):
        tried.clear()
        time_s = step * np.arange(rows)
        assert divergence.divergence(time_s, np.sin(time_s)) is None
        assert tried[0] == pytest.approx(first)
        assert np.divide(tried[1:], tried[:-1]) == pytest.approx(np.sqrt(2.0))
        assert last / np.sqrt(2.0) < tried[-1] <= last


def test_words_of_growth() -> None:
    for hertz, held, parts in (
        (2.5, 0.9, ("as an oscillation of 2.5 Hz", "and the flight ends so", "halve P, I and D")),
        (None, 1.1, ("to one side", "and stays there until the flight ends", "look for motors")),
    ):
        found = divergence.Divergence(1.0, 9.0, 0.1, 1.0, 1.0, hertz, held)
        told = divergence._finding("roll", True, found)
        words = f"{told.message} {told.action}"
        assert all(part in words for part in parts)
        assert "roll rate diverges" in words
        assert "from 5.73 to 57.3 deg/s rms between 1.0 and 9.0 s, by e in 1 s" in words
    assert "roll angle diverges" in divergence._finding("roll", False, found).message
