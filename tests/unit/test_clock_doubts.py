"""What the relation of two clocks does not hold: edges between samples, steps, opposite signs."""

from __future__ import annotations

import numpy as np
import pytest

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.record.clocks import Signal, clock_offset

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


def test_values_that_a_log_repeats_count_where_they_are_new() -> None:
    held_s = np.floor(TIME_S / 0.1 + 1e-9) * 0.1
    found = clock_offset((TIME_S, smooth(TIME_S)), (TIME_S + 2.0, smooth(held_s)), "x")
    assert found.half_width_s is not None
    assert abs(found.offset_s + 2.0) <= found.half_width_s <= 0.01


def test_an_opposite_sign_and_an_offset_of_unix_stamps_are_said() -> None:
    first, (stamps, values) = pair(0.0)
    with pytest.raises(DataError, match="opposite signs"):
        clock_offset(first, (stamps, -values), "x")
    said = clock_offset(first, (stamps + 1.7e9, values), "x").said
    assert "clock offset -1699999995.00" in said
