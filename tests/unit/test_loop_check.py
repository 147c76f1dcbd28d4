"""A plan's loop beside the flown one, on closed loops that NumPy and SciPy simulate."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.signal

import flightid as fid
from flightid.conventions import Light
from flightid.planning.flown_axis import FlownAxis
from flightid.planning.loop_check import LARGEST_MISS, LoopCheck, _interval, check_loop

STEP_S, ANGLE_P, LATE = 0.0025, 4.5, 6
OMEGA = np.geomspace(2.0, 60.0, 24)
CHANNELS = ("p_ref", "p", "phi_ref")


def axis_of(gain: float, tau_s: float, share: float) -> FlownAxis:
    """An axis with a proportional rate loop; a held input adds half a sample of delay."""
    loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=1.0 / STEP_S)
    gains = {"p": share / gain, "i": 0.0, "d": 0.0, "fltt": 0.0, "fltd": 0.0}
    loop = loop.with_gains({loop.names[role]: value for role, value in gains.items()})
    late_s = (LATE + 0.5) * STEP_S
    return FlownAxis(gain, tau_s, late_s, motor_lag_s=0.05, loop=loop)


def flown(axis: FlownAxis, seconds: float, gust_rad_s: float, seed: int) -> fid.Record:
    """Doublets of the attitude set-point in gusts, sample by sample."""
    assert axis.loop is not None
    rng, count = np.random.default_rng(seed), round(seconds / STEP_S)
    stick, start = np.zeros(count), 0
    while start < count - round(3.0 / STEP_S):
        width, size = round(rng.uniform(0.3, 1.0) / STEP_S), rng.uniform(0.05, 0.25)
        stick[start : start + 2 * width] = np.repeat([size, -size], width)
        start += 2 * width + round(rng.uniform(0.0, 2.0) / STEP_S)
    stick = scipy.signal.lfilter(*scipy.signal.butter(2, 8.0 * STEP_S), stick)
    kept = math.exp(-STEP_S / 0.5)
    gust = scipy.signal.lfilter([1.0 - kept], [1.0, -kept], rng.standard_normal(count))
    gust = gust * gust_rad_s / gust.std() + 0.003 * rng.standard_normal(count)
    lags = np.array([axis.time_constant_s, axis.motor_lag_s])
    decay = np.exp(-STEP_S / lags)
    parts = axis.gain * lags * np.array([1.0, -1.0]) / (lags[0] - lags[1])
    state, angle, late = np.zeros(2), 0.0, [0.0] * LATE
    rate, wanted = np.zeros(count), np.zeros(count)
    for k in range(count):
        rate[k] = parts @ state + gust[k]
        wanted[k] = ANGLE_P * (stick[k] - angle)
        late.append(axis.loop.values["p"] * (wanted[k] - rate[k]))
        state = decay * state + (1.0 - decay) * late.pop(0)
        angle += STEP_S * rate[k]
    return fid.Record.from_arrays(
        STEP_S * np.arange(count), inputs={"p_ref": wanted, "phi_ref": stick},
        outputs={"p": rate}, units={"p_ref": "rad/s", "phi_ref": "rad", "p": "rad/s"},
    )  # fmt: skip


def checked(seed: int, gust_rad_s: float, seconds: float, scale: float) -> LoopCheck:
    """A flight held against a prediction whose gain is `scale` times the true one."""
    rng = np.random.default_rng(100 + seed)
    gain, tau, share = np.array([80.0, 0.5, 4.0]) * np.exp(rng.uniform(-0.3, 0.3, 3))
    axis = axis_of(gain, tau, share)
    record = flown(axis, seconds, gust_rad_s, seed)
    assert axis.loop is not None
    found = check_loop([record], CHANNELS, replace(axis, gain=scale * gain), axis.loop, OMEGA)
    assert found is not None
    return found


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_right_loops_hold_and_wrong_ones_are_missed(seed: int) -> None:
    assert checked(seed, 0.1, 65.0, 1.0).finding("roll").light is Light.GREEN
    wrong = checked(seed, 0.1, 65.0, 2.0)
    assert wrong.finding("roll").code == "loop-not-as-flown"
    assert wrong.least > LARGEST_MISS


def test_an_interval_around_the_limit_tells_nothing() -> None:
    told = LoopCheck(0.27, 0.2, 0.35, 2.0, 20.0).finding("roll")
    assert (told.code, told.light) == ("loop-untold", Light.UNKNOWN)
    assert "20 % to 35 %" in told.message
    assert "holds to 30 % is not told" in told.message


def test_bounds_of_a_quadratic_form_hold_as_they_say() -> None:
    # Errors of 10 % at twelve frequencies, neighbours correlated; the miss is exactly 0.3.
    rng, n = np.random.default_rng(2), 12
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    covariance = np.kron(np.eye(2), 0.1**2 * 0.5**apart)
    root, weight = np.linalg.cholesky(covariance), np.full(n, 1.0 / n)
    below = above = 0
    for _ in range(2000):
        error = root @ rng.standard_normal(2 * n)
        logs = 0.3 + error[:n] + 1j * error[n:]
        _, least, most = _interval(logs, covariance, weight)
        # The allowance for bias is taken back: what is left is chance's.
        below, above = below + (least + 0.04 > 0.3), above + (most - 0.04 < 0.3)
    # 5 % by a normal approximation to a noncentral sum of squares, good to a point or two.
    assert 0.025 < below / 2000 < 0.075
    assert 0.025 < above / 2000 < 0.075


@pytest.mark.nightly
def test_a_hundred_loops() -> None:
    right = [checked(seed, 0.2, 50.0, 1.0) for seed in range(100)]
    wrong = [checked(seed, 0.2, 50.0, 2.0) for seed in range(100)]
    assert not any(each.is_missed for each in right)
    assert not any(each.holds for each in wrong)
    assert sum(each.is_missed for each in wrong) >= 80
