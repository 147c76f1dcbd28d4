"""Filters of the autopilots against SciPy's designs, and the slew limiter against a second one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from flightid import _native
from flightid.control.autopilots.filters import (
    difference_response,
    one_pole_response,
    sections_response,
)
from flightid.vehicles import RateGains
from tests.closeness import assert_close

RATE_HZ = 1000.0
OMEGA = np.geomspace(1.0, 3000.0, 40)


def _scipy(b: np.ndarray, a: np.ndarray) -> np.ndarray:
    return signal.freqz(b, a, worN=OMEGA, fs=2 * np.pi * RATE_HZ)[1]


@pytest.mark.parametrize("cutoff_hz", [5.0, 40.0, 150.0])
def test_gyro_low_pass_is_a_butterworth_section(cutoff_hz: float) -> None:
    section = _native.gyro_low_pass_section(RATE_HZ, cutoff_hz)
    assert section is not None
    theirs = _scipy(*signal.butter(2, cutoff_hz, fs=RATE_HZ))
    ours = sections_response([section], OMEGA, RATE_HZ)
    assert_close(ours, theirs, atol=1e-12, why="same prewarped design")
    assert _native.gyro_low_pass_section(RATE_HZ, 0.0) is None


def test_px4_notch_is_the_textbook_notch() -> None:
    section = _native.px4_notch_section(RATE_HZ, 80.0, 20.0)
    assert section is not None
    theirs = _scipy(*signal.iirnotch(80.0, 80.0 / 20.0, fs=RATE_HZ))
    ours = sections_response([section], OMEGA, RATE_HZ)
    assert_close(ours, theirs, atol=1e-12, why="same bilinear notch")


def test_ardupilot_notch_has_its_depth_and_shape() -> None:
    # Peaking section of the audio cookbook with gain −A dB: b = 1 ± α A², a = 1 ± α.
    section = _native.ardupilot_notch_section(RATE_HZ, 80.0, 2.0, 30.0)
    assert section is not None
    at = sections_response([section], 2 * np.pi * np.array([80.0]), RATE_HZ)
    assert_close(np.abs(at), [10 ** (-30 / 20)], rtol=1e-12, why="30 dB at the centre")
    far = sections_response([section], np.array([1.0, np.pi * RATE_HZ]), RATE_HZ)
    assert_close(np.abs(far), [1.0, 1.0], atol=1e-4, why="nothing far from it")
    quality = _native.ardupilot_notch_quality(80.0, 20.0)
    octaves = 2 * np.log2(80.0 / 70.0)
    exact = np.sqrt(2**octaves) / (2**octaves - 1)
    assert_close(quality, exact, rtol=1e-12, why="bandwidth in octaves below the centre")


def test_one_pole_and_difference_are_their_recursions() -> None:
    weight = 1e-3 / (1e-3 + 1 / (2 * np.pi * 20.0))
    theirs = _scipy(np.array([weight]), np.array([1.0, weight - 1]))
    assert_close(one_pole_response(20.0, OMEGA, RATE_HZ), theirs, atol=1e-12, why="same recursion")
    theirs = RATE_HZ * _scipy(np.array([1.0, -1.0]), np.array([1.0]))
    assert_close(difference_response(OMEGA, RATE_HZ), theirs, rtol=1e-9, why="backward difference")


class _PlainLimiter:
    """The slew limiter again, from the description of its rules, one loop at a time."""

    def __init__(self, limit: float, dt: float) -> None:
        self.limit, self.dt, self.loop = limit, dt, 0
        self.filtered = self.last = self.for_gain = 0.0
        self.peak = {1: 0.0, -1: 0.0}
        self.peak_ms = {1: 0, -1: 0}
        self.events: dict[int, list[int]] = {1: [0, 0], -1: [0, 0]}
        self.waiting_for = 0

    def __call__(self, demand: float) -> float:
        now_ms = 1_000_000 + int(self.loop * self.dt * 1000)
        self.loop += 1
        rc = 1 / (2 * np.pi * 25.0)
        self.filtered += ((demand - self.last) / self.dt - self.filtered) * self.dt / (self.dt + rc)
        self.last = demand
        for side in (1, -1):
            if side * self.filtered > self.limit and self.waiting_for in (0, side):
                # Two events a side are kept; the older one goes.
                self.events[side] = [self.events[side][1], now_ms]
                self.waiting_for = -side
            if side * self.filtered > self.peak[side]:
                self.peak[side] = min(side * self.filtered, 10 * self.limit)
                self.peak_ms[side] = now_ms
            elif now_ms - self.peak_ms[side] > 300:
                self.peak[side] *= 1 - self.dt
        raw = 0.5 * (self.peak[1] + self.peak[-1])
        oldest = min(self.events[1] + self.events[-1])
        if now_ms - oldest > 900:
            raw *= np.exp(-0.001 * (now_ms - oldest - 900))
        self.for_gain = min((1 - 2 * self.dt) * self.for_gain + 2 * self.dt * raw, raw)
        excess = self.for_gain - self.limit
        return self.limit / (self.limit + 1.5 * excess) if excess > 0 else 1.0


@pytest.mark.parametrize("limit", [0.5, 2.0])
def test_slew_limiter_agrees_with_a_second_implementation(limit: float) -> None:
    gains = RateGains(p=0.2, i=0.0, d=0.004, fltt=0.0, smax=limit).to_native()
    dt, n = 0.0025, 3000
    t = np.arange(n) * dt
    target = 0.6 * np.sin(2 * np.pi * 7 * t) * (t > 1.0) * (t < 4.0)
    flags = np.zeros(n, dtype=bool)
    rows = _native.ardupilot_pid(gains, dt, target, np.zeros(n), flags, None, 1.0, None, False)
    limiter = _PlainLimiter(limit, dt)
    demands = np.concatenate([[0.0], rows[:-1, 2] + rows[:-1, 4]])
    theirs = np.array([limiter(demand) for demand in demands])
    assert theirs.min() < 0.8
    assert_close(rows[:, 7], theirs, atol=1e-9, why="the same rules")
