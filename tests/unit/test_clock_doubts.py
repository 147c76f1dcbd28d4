"""What the relation of two clocks does not hold: edges between samples, steps, opposite signs."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.record import clocks
from flightid.record.clocks import Signal, clock_offset
from tests.closeness import assert_close

TIME_S = 0.01 * np.arange(12_000)


def smooth(time_s: np.ndarray) -> np.ndarray:
    """Tones that share no period."""
    tones = np.sqrt([0.11, 0.53, 1.19, 2.41, 4.37])
    return np.asarray(sum(np.sin(6.283 * hz * time_s + 7.0 * hz * hz) for hz in tones))


def pair(step_s: float) -> tuple[Signal, Signal]:
    """One signal on two clocks 5 s apart, the second stepping in the middle."""
    true_s = TIME_S[300:-300] + 0.0037
    stamps = true_s - 5.0 + np.where(true_s > 60.0, step_s, 0.0)
    noise = 0.02 * np.random.default_rng(1).standard_normal((2, TIME_S.size))
    return (TIME_S, smooth(TIME_S) + noise[0]), (stamps, smooth(true_s) + noise[1, 300:-300])


def test_a_clock_that_steps_is_red_and_one_that_does_not_is_not() -> None:
    finding = clock_offset(*pair(0.02), "x").finding
    assert finding is not None
    assert (finding.code, finding.light) == ("clock-steps", Light.RED)
    assert clock_offset(*pair(0.0), "x").finding is None


def test_edges_of_a_held_signal_are_known_within_its_spacings() -> None:
    levels = np.random.default_rng(2).choice([-1.0, 1.0], 500)
    time_s = 0.02 * np.arange(5_800) + 1.0
    second = (1.0 + 80e-6) * time_s + 3.1234
    found = clock_offset(
        (TIME_S, levels[(TIME_S / 0.3 + 1e-9).astype(int)]),
        (time_s, levels[(second / 0.3 + 1e-9).astype(int)]),
        "u",
    )
    error = np.abs(found.offset_s - 3.1234 + (found.drift - 80e-6) * time_s[[0, -1]])
    assert found.half_width_s is not None
    assert np.max(error) <= found.half_width_s


def test_the_interval_holds_at_the_end_that_is_farther_from_what_moves() -> None:
    own = 5.0 + 1e-3 * np.array([1.0, -1.0, -1.0, 1.0, 0.0])
    given = iter(own)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(clocks, "_matched", lambda *_: next(given))
        moving = smooth(TIME_S) * (TIME_S < 50.0)
        found = clock_offset((TIME_S, moving), (TIME_S - 5.0, moving), "x")
    line = scipy.stats.linregress(5.0 + 10.0 * np.arange(5), own)
    at_end_s = np.hypot(line.stderr * np.sqrt(200.0), line.stderr * (119.99 - 25.0))
    half_s = scipy.stats.t.ppf(1.0 - 0.05 / 4.0, 3) * at_end_s
    assert_close(found.half_width_s, half_s, rtol=1e-3, why="stretches begin and end at samples")


@pytest.mark.parametrize("hz", [10.0, 80.0])
def test_values_that_a_log_repeats_count_where_they_are_new(hz: float) -> None:
    held_s = np.floor(TIME_S * hz + 1e-9) / hz
    found = clock_offset((TIME_S, smooth(TIME_S)), (TIME_S + 2.0, smooth(held_s)), "x")
    assert found.half_width_s is not None
    assert abs(found.offset_s + 2.0) <= found.half_width_s <= 0.01


def test_an_opposite_sign_and_an_offset_of_unix_stamps_are_said() -> None:
    first, (stamps, values) = pair(0.0)
    with pytest.raises(DataError, match="opposite signs"):
        clock_offset(first, (stamps, -values), "x")
    said = clock_offset(first, (stamps + 1.7e9, values), "x").said
    assert "clock offset -1699999995.00" in said
