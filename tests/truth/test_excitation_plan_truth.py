"""Predictions of a plan against simulation, finite differences and hand calculation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from flightid import excitation
from flightid.excitation import RateAxis
from flightid.excitation.vehicle import MEMORY
from tests.closeness import assert_close

DT = 0.002


def _chirp() -> np.ndarray:
    made = excitation.sweep(
        band_rad_s=(1.0, 15.0), amplitude=0.1, duration_s=40.0, sample_rate_hz=1 / DT
    )
    return np.asarray(made.signals[0])


@pytest.mark.parametrize(
    ("rate_feedback", "attitude_feedback"), [(0.0, 0.0), (0.1, 0.0), (0.1, 4.0)]
)
def test_flight_of_the_guess_is_the_simulated_one(
    rate_feedback: float, attitude_feedback: float
) -> None:
    gain, lag = 40.0, 0.2
    axis = RateAxis(
        gain=gain,
        time_constant_s=lag,
        rate_feedback=rate_feedback,
        attitude_feedback_per_s=attitude_feedback,
    )
    excited = _chirp()
    flown = axis.fly(excited, DT)
    a = np.array(
        [[-(1 + gain * rate_feedback) / lag, -gain * rate_feedback * attitude_feedback / lag],
         [1.0, 0.0]]
    )  # fmt: skip
    b = np.array([[gain / lag], [0.0]])
    feedback = np.array([[-rate_feedback, -rate_feedback * attitude_feedback]])
    c, d = np.vstack([np.eye(2), feedback]), np.array([[0.0], [0.0], [1.0]])
    _, expected, _ = signal.lsim((a, b, c, d), excited, np.arange(excited.size) * DT)
    for index, name in enumerate(("rate", "attitude", "input")):
        scale = np.max(np.abs(expected[:, index]))
        assert_close(
            flown[name],
            expected[:, index],
            atol=2e-3 * scale,
            why="between samples the transform assumes a band-limited input, lsim straight lines",
        )


def test_delay_shifts_the_rate_by_itself() -> None:
    plain = RateAxis(gain=5.0, time_constant_s=0.3)
    late = RateAxis(gain=5.0, time_constant_s=0.3, delay_s=0.1)
    excited = _chirp()
    shifted = np.concatenate([np.zeros(50), plain.fly(excited, DT)["rate"][:-50]])
    assert_close(
        late.fly(excited, DT)["rate"], shifted, atol=1e-6, why="50 samples, up to the silent end"
    )
    assert np.exp(-MEMORY) < 1e-5


def test_information_is_that_of_finite_differences() -> None:
    base = {"gain": 8.0, "time_constant_s": 0.15, "delay_s": 0.03}
    axis = RateAxis(**base, noise_rad_s=0.05)
    control = _chirp()
    slopes = []
    for name, value in base.items():
        step = 1e-4 * value
        high = RateAxis(**{**base, name: value + step}).fly(control, DT)["rate"]
        low = RateAxis(**{**base, name: value - step}).fly(control, DT)["rate"]
        slopes.append((high - low) / (2 * step))
    expected = np.array(slopes) @ np.array(slopes).T / 0.05**2
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert_close(
        axis.information(control, DT) / scale,
        expected / scale,
        atol=1e-6,
        why="central differences of 1e-4",
    )


def test_slowest_mode_of_the_loop() -> None:
    axis = RateAxis(gain=40.0, time_constant_s=0.2, rate_feedback=0.1, attitude_feedback_per_s=2.0)
    roots = np.roots([0.2, 1 + 4.0, 4.0 * 2.0])
    assert_close(axis.slowest_s(), -1 / np.max(roots.real), rtol=1e-9, why="quadratic by hand")
    assert_close(
        RateAxis(gain=40.0, time_constant_s=0.2, rate_feedback=0.1).slowest_s(),
        0.04,
        rtol=1e-9,
        why="T / (1 + K k)",
    )


def test_random_error_of_a_plan_by_hand() -> None:
    made = excitation.multisine(
        band_rad_s=(1.0, 30.0), amplitude=0.1, period_s=60.0, sample_rate_hz=200.0, starts=1
    )
    axis = RateAxis(gain=2.0, time_constant_s=0.001, noise_rad_s=0.5)
    plan = excitation.assess(made, axis, n_records=3)
    density = made.rms[0] ** 2 / (29.0 / (2 * np.pi))
    ratio = 4.0 * density / (2 * 0.005 * 0.25)
    middle = np.searchsorted(plan.omega_rad_s, 10.0)
    assert_close(
        plan.axes[0].coherence[middle],
        ratio / (1 + ratio),
        rtol=0.01,
        why="flat power, flat gain, white noise",
    )
    window = min(w for w in plan.windows_s if plan.omega_rad_s[middle] >= 4 * np.pi / w)
    coherence = plan.axes[0].coherence[middle]
    expected = np.sqrt(0.55 * (1 - coherence) / coherence / (2 * 180.0 / window))
    assert_close(plan.axes[0].random_error[middle], expected, rtol=1e-12, why="Bendat & Piersol")
