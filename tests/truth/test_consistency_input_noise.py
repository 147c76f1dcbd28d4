"""Noise of rates and accelerometers: how it reaches the outputs, and whether intervals carry it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from flightid.conditioning import check_consistency
from flightid.conditioning.kinematics import INPUTS, KinematicModel
from flightid.uncertainty.input_noise import white_deviation
from flightid.uncertainty.periodograms import periodogram
from flightid.uncertainty.residual_noise import autoregression
from tests.closeness import assert_close
from tests.truth.test_consistency import FORCES, TRUTH, flight

OUTPUTS = ("phi", "theta", "psi", "vn", "V")
STARTS = tuple(f"{name}_0" for name in ("phi", "theta", "psi", "u", "v", "w"))
# Gyro noise beside coloured output noise: small, equal and overwhelming; and with velocities.
CASES: dict[str, dict[str, Any]] = {
    "no-gyro-noise": {"noise": 0.004, "colour": 0.9},
    "gyro-noise": {"noise": 0.004, "colour": 0.9, "gyro": 0.002},
    "much-gyro-noise": {"noise": 0.001, "colour": 0.9, "gyro": 0.02},
    "velocities": {
        "outputs": ("phi", "theta", "psi", "vn", "ve", "vd"),
        "truth": {**TRUTH, **FORCES},
        "noise": 0.004,
        "colour": 0.9,
        "gyro": 0.002,
        "accelerometer": 0.05,
        "n": 800,
    },
}


def _model(n: int = 150) -> tuple[KinematicModel, np.ndarray]:
    record = flight(OUTPUTS, n=n)
    inputs = {name: record[name] for name in INPUTS}
    parameters = (*STARTS, "scale_p", "delay_phi", "scale_vn")
    theta = np.array([0.1, 0.2, 0.3, 15.0, 0.5, 1.0, 0.1, 0.06, 0.05])
    return KinematicModel(record.time_s, inputs, OUTPUTS, parameters), theta


@pytest.mark.parametrize("name", INPUTS)
def test_a_noisy_sample_reaches_the_outputs_as_the_reconstruction_says(name: str) -> None:
    model, theta = _model()
    noise = model.input_noise(theta)
    noise.deviations[:] = 1.0
    draw = np.zeros((149, 6, 1))
    # A smooth bump of noise: its spline between the samples holds it as the steps do.
    bump = np.exp(-(((np.arange(150) - 60) / 12.0) ** 2))
    draw[:, INPUTS.index(name), 0] = (bump[1:] + bump[:-1]) / 2
    change = 1e-4
    moved = KinematicModel(
        model.time_s,
        {**model.inputs, name: model.inputs[name] + change * bump},
        model.outputs,
        model.parameters,
    )
    expected = (moved.predict(theta).values - model.predict(theta).values) / change
    found = noise.outputs_of(draw)[:, :, 0]
    size = np.max(np.abs(expected))
    assert_close(found, expected, atol=0.01 * size, why="one step's rounding of the sums")


def test_the_transpose_is_the_transpose() -> None:
    model, theta = _model()
    noise = model.input_noise(theta)
    random = np.random.default_rng(0)
    noise.deviations[:] = random.uniform(1, 2, 6)
    draw = random.standard_normal((149, 6, 1))
    weights = random.standard_normal((len(OUTPUTS), 150, 1))
    left = float(np.sum(noise.outputs_of(draw) * weights))
    right = float(np.sum(noise.transposed(weights) * draw))
    assert_close(left, right, rtol=1e-10, why="one bilinear form")


def test_noise_of_a_channel_is_seen_beside_motion_and_vibration() -> None:
    time_s = np.arange(3000) / 100
    noise = 0.02 * np.random.default_rng(3).standard_normal(3000)
    motion = np.sin(2 * np.pi * time_s) + 0.5 * np.sin(2 * np.pi * 37.3 * time_s)
    assert_close(white_deviation(motion + noise), 0.02, rtol=0.1, why="750 ordinates, a median")


def test_the_walk_is_left_out_of_the_stationary_model() -> None:
    random = np.random.default_rng(5)
    n = 2000
    own = lfilter([1.0], [1, -0.6], random.standard_normal((n + 100, 1)), axis=0)[100:]
    walks = np.cumsum(0.1 * random.standard_normal((n, 200)), axis=0)
    walks -= walks.mean(axis=0)
    power = periodogram(own + walks[:, :1])
    plain = autoregression(power, n).autocovariance(50)[0]
    parted = autoregression(power, n, periodogram(walks)).autocovariance(50)[0]
    assert abs(parted - 1.5625) < 0.3 * abs(plain - 1.5625), (plain, parted)


def _deviates(case: dict[str, Any], seeds: range) -> np.ndarray:
    """Errors of the estimates in standard errors, (n_seeds, n_parameters)."""
    truth = case.get("truth", TRUTH)
    rows = []
    for seed in seeds:
        found = check_consistency(flight(seed=seed, **case), estimate=[*truth]).parameters
        rows.append([(found[k].value - v) / found[k].stderr for k, v in truth.items()])
    return np.array(rows)


@pytest.mark.slow
def test_errors_are_as_large_as_the_standard_errors_say() -> None:
    case = {**CASES["much-gyro-noise"], "n": 600}
    square = np.mean(_deviates(case, range(12)) ** 2)
    # 108 squares, some of them dependent: deviation about 0.2. Without the walk: 30 and more.
    assert 0.45 < square < 1.7


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_intervals_are_calibrated_with_noisy_inputs(name: str) -> None:
    case = CASES[name]
    truth = case.get("truth", TRUTH)
    inside = []
    for seed in range(200):
        found = check_consistency(flight(seed=seed, **case), estimate=[*truth]).parameters
        bounds = [(*found[key].interval95, value) for key, value in truth.items()]
        inside += [low <= value <= high for low, high, value in bounds]
    assert 0.93 <= np.mean(inside) <= 0.97
