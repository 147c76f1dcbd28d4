"""What excited a flight, at both sides of every limit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.inspection import excitation_found, rate_chirps
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.signals import Signal
from flightid.inspection.thresholds import RESTING_RATE
from tests.handmade_log import HandmadeLog

Array = np.ndarray


def test_sweeps_shrink_their_half_periods_steadily() -> None:
    t = np.arange(0.0, 30.0, 0.01)

    def wave(first: float, last: float) -> Array:
        return np.sin(2.0 * np.pi * (first * t + (last - first) / 60.0 * t**2) + 0.3)

    up = excitation_found._sweep(t, wave(0.5, 5.0))
    assert up is not None
    # After c cycles the frequency is sqrt(0.25 + 0.3 c): medians of ten cycles at either end.
    assert up == (pytest.approx(1.35, abs=0.05), pytest.approx(4.9, abs=0.15))
    down = excitation_found._sweep(t, wave(0.5, 5.0)[::-1].copy())
    assert down is not None
    assert down[0] > down[1]
    assert excitation_found._sweep(t, wave(1.0, 1.5)) is None
    assert excitation_found._sweep(t[:300], wave(0.5, 5.0)[:300]) is None
    # What stays within three tenths of the ninth decile is no turn.
    noisy = wave(0.5, 5.0) + 0.25 * np.sin(300.0 * t)
    assert excitation_found._sweep(t, noisy) is not None


def test_what_excited_a_span_is_told_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(0.0, 12.0, 0.02)
    stairs = 0.2 * (np.floor(t / 3.0) % 2)
    # Half of the time at 0.1 spreads by 0.05, the limit, with which it counts.
    limit = np.where(stairs > 0.0, 2.0 * RESTING_RATE.value, 0.0)
    for kind, values in (("steps", stairs), ("steps", limit), (None, 0.4 * stairs)):
        found = excitation_found._shape(
            Signal("p_ref", t, values, "rad/s", "x"), "roll", (0.0, 12.0)
        )
        assert (found and found.kind) == kind
    told = excitation_found._shape(Signal("p_ref", t, stairs, "rad/s", "x"), "roll", (0.0, 12.0))
    assert told is not None
    assert (told.detail, told.start_s, told.stop_s) == ("3 steps of the set-point", 0.0, 12.0)
    one = Signal("p_ref", t, 0.2 * (t > 6.0), "rad/s", "x")
    assert excitation_found._shape(one, "roll", (0.0, 12.0)) is None
    assert excitation_found._shape(None, "roll", (0.0, 12.0)) is None
    few = np.repeat([0.0, 1.0, 0.0], [6, 7, 7])
    for skipped, is_told in ((0, True), (1, False)):
        short = Signal("p_ref", 0.05 * np.arange(skipped, 20), few[skipped:], "rad/s", "x")
        assert (excitation_found._shape(short, "roll", (0.0, 9.0)) is not None) is is_told
    for spread, is_told in ((0.051, True), (0.049, False)):
        rate = Signal("p", t, spread * np.where(np.arange(t.size) % 2, 1.0, -1.0), "rad/s", "x")
        motion = excitation_found._motion(rate, "roll", (0.0, 12.0), "pilot", "plain")
        assert (motion is not None) is is_told
        outside = excitation_found._motion(rate, "roll", (50.0, 60.0), "pilot", "plain")
        assert outside is None
    each = FoundExcitation("sid", "roll", 2.0, 5.0, "")
    spans = ((0.0, 2.0), (0.0, 2.1), (5.0, 9.0), (4.9, 9.0), (2.5, 3.0))
    assert [excitation_found._overlap(span, each) for span in spans] == [
        False,
        True,
        False,
        True,
        True,
    ]
    log: Any = HandmadeLog("px4", sid_runs=())
    name = "autotune_attitude_control_status"
    states = list(excitation_found.PX4_AUTOTUNE)
    log.with_table(name, [1.0, 2.0, 3.0, 4.0, 5.0], state=[states[0], states[0], states[1], 0, 0])
    found = excitation_found._autotune(log)
    assert [(e.start_s, e.stop_s, e.kind) for e in found] == [(1.0, 2.0, "autotune")]
    copter: Any = HandmadeLog("ardupilot").with_table("ATUN", [3.0, 1.0, 8.0])
    assert [(e.start_s, e.stop_s) for e in excitation_found._autotune(copter)] == [(1.0, 8.0)]
    chirp = rate_chirps.FoundChirp("yaw", (1.0, 2.0), 0.123, 45.67, 89.12)
    monkeypatch.setattr(excitation_found, "chirps", lambda _: (chirp,))
    assert excitation_found.injected_spans(log) == [(1.0, 2.0)]
    (found_chirp,) = excitation_found._chirped(log)
    assert (found_chirp.axis, found_chirp.start_s, found_chirp.stop_s) == ("yaw", 1.0, 2.0)
    log.sid_runs = (SimpleNamespace(start_s=3.0, stop_s=4.0),)
    assert excitation_found.injected_spans(log) == [(3.0, 4.0)]


def chirped(
    seconds: float = 12.0, size: float = 1.0, sticks: float = 0.0, most_hz: float = 20.0
) -> Any:
    """A Betaflight log at 200 Hz: a phase from 3 s on, which roll's set-point follows."""
    t = np.arange(0.0, seconds + 6.0, 0.005)
    on = (t >= 3.0) & (t < 3.0 + seconds)
    at = t - 3.0
    phase = np.mod(
        2.0 * np.pi * (0.5 * at + (most_hz - 0.5) / (2.0 * seconds) * at**2), 2.0 * np.pi
    )
    moved = size * np.cos(phase + 0.4) * on + sticks * np.sin(2.0 * np.pi * 31.7 * t)
    log: Any = HandmadeLog("betaflight")
    log.with_table("main", t, **{"debug[0]": np.round(np.where(on, phase, 0.0) * 5000.0)})
    signals = {
        "p_ref": Signal("p_ref", t, moved, "rad/s", "x"),
        "q_ref": Signal("q_ref", t, np.sin(t), "rad/s", "y"),
    }
    return log, signals


def test_a_chirp_is_where_a_set_point_moves_with_its_phase(monkeypatch: pytest.MonkeyPatch) -> None:
    def found(**either: float) -> tuple[rate_chirps.FoundChirp, ...]:
        log, signals = chirped(**either)
        monkeypatch.setattr(rate_chirps, "find", lambda _, name: signals.get(name))
        return rate_chirps.chirps(log)

    (each,) = found()
    assert (each.axis, each.size_deg_s) == ("roll", pytest.approx(57.3, rel=0.01))
    assert each.span_s == (pytest.approx(3.0, abs=0.011), pytest.approx(15.0, abs=0.011))
    assert (each.low_hz, each.high_hz) == (
        pytest.approx(0.6, abs=0.15),
        pytest.approx(19.9, abs=0.2),
    )
    # Power of the phase over all: six tenths.
    assert len(found(sticks=0.8)) == 1
    assert len(found(sticks=0.84)) == 0
    assert len(found(seconds=1.9)) == 0
    assert len(found(seconds=2.2, most_hz=10.0)) == 1
    assert len(found(seconds=4.0, most_hz=3.6)) == 1
    assert len(found(seconds=4.0, most_hz=3.3)) == 0
    # From 2.5 rad a sample on the log is too slow: 80 Hz of 200.
    assert found(seconds=20.0, most_hz=95.0)[0].high_hz == pytest.approx(79.0, abs=1.0)
    log, _ = chirped()
    log.kind = "ardupilot"
    assert rate_chirps.chirps(log) == ()


def test_stretches_with_a_phase_last_two_seconds_with_short_zeros() -> None:
    t = np.arange(0.0, 10.0, 0.05)
    for start, stop, hole, count in (
        (1.0, 3.01, None, 1),
        (1.0, 2.96, None, 0),
        (1.0, 6.0, (3.0, 3.2), 1),
        (1.0, 6.0, (3.0, 3.3), 2),
    ):
        phase = ((t >= start - 1e-9) & (t <= stop)).astype(float)
        if hole is not None:
            phase[(t > hole[0]) & (t < hole[1] - 1e-9)] = 0.0
        found = rate_chirps._active(t, phase)
        assert len(found) == count
        if count == 1:
            assert t[found[0][[0, -1]]] == pytest.approx([start, stop], abs=0.011)
    assert rate_chirps._active(t, 0.0 * t) == []
    assert rate_chirps._moved(np.zeros(99), np.arange(99.0))[0] == 0.0
