"""Comparisons and free runs of unstable models against what is known exactly."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.linalg import expm

import flightid as fid
from flightid.conventions import Light
from flightid.models.linear.linear_system import LinearSystem
from flightid.validation.verification.comparison import N_STRETCHES, swap_p_value
from tests.closeness import assert_close

A = np.array([[0.5, 1.0, 0.0], [-1.0, 0.5, 0.0], [0.3, 0.0, -2.0]])
B = np.array([[0.0, 0.2], [1.0, 0.0], [0.4, 0.0]])
D = np.array([[0.0, 0.1], [0.0, 0.0], [0.0, 0.0]])
START = np.array([0.3, -0.2, 0.1])
STEP_S = 0.02


def _unstable(a: np.ndarray = A, delays_s: tuple[float, float] = (0.0, 0.0)) -> LinearSystem:
    return LinearSystem(a, B, np.eye(3), D, ("a", "b"), ("x", "y", "z"), delays_s)


@cache
def _held(duration_s: float, noise: float = 0.0) -> fid.Record:
    """Steps of a controller hold the unstable model; its states are sampled exactly."""
    whole = expm(np.block([[A, B], [np.zeros((2, 5))]]) * STEP_S)
    gains = np.array([[2.0, 3.0, 0.0], [0.0, 0.0, 0.0]])
    state, states, inputs = START, [], []
    drawn = np.random.default_rng(0).standard_normal((3, int(duration_s / STEP_S)))
    for k in range(drawn.shape[1]):
        moves = [np.sin(1e-5 * k * k), np.cos(0.006 * k)]
        inputs.append(moves - gains @ state)
        states.append(state)
        state = whole[:3, :3] @ state + whole[:3, 3:] @ inputs[-1]
    u, x = np.array(inputs).T, np.array(states).T
    y = x + D @ u + noise * drawn
    return fid.Record.from_arrays(
        STEP_S * np.arange(u.shape[1]),
        inputs={"a": u[0], "b": u[1]},
        outputs={"x": y[0], "y": y[1], "z": y[2]},
    )


# Over 1000 s the mode grows by exp(500): no run forward in time can hold a digit.
@pytest.mark.parametrize("duration_s", [20.0, 500.0])
@pytest.mark.parametrize("shifts", [False, True])
def test_an_unstable_model_runs_freely_through_a_record_of_any_length(
    duration_s: float, shifts: bool
) -> None:
    result = fid.verify(
        _unstable(),
        _held(duration_s),
        initial_state="estimate",
        hold="zero",
        state_bias=shifts,
        output_bias=shifts,
    )
    for error in result.rms_error.values():
        assert_close(error, 0.0, atol=1e-12, why="the model is the truth")
    if not shifts:
        start = result.predictions[0].shifts.initial_state
        assert_close(start, START, atol=1e-12, why="the state at the first sample")
    growth = [each for each in result.findings if each.code == "verification-growth"]
    assert growth[0].light is Light.GREEN
    assert "predicted with a Theil coefficient of 0.000" in growth[0].message
    assert f"exp({0.5 * (duration_s - STEP_S):.3g})" in growth[0].message


def test_noise_is_all_that_is_left_on_a_long_unstable_record() -> None:
    result = fid.verify(
        _unstable(), _held(300.0, noise=0.01), initial_state="estimate", hold="zero"
    )
    for error in result.rms_error.values():
        assert_close(error, 0.01, rtol=0.03, why="15 000 samples of noise")


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_backward_runs_keep_delays_and_holds(hold: str) -> None:
    model = _unstable(delays_s=(0.033, 0.11))
    time_s = STEP_S * np.arange(600)
    inputs = {"a": np.sin(2 * time_s), "b": np.sign(np.sin(3 * time_s + 0.1))}
    flown = fid.Record.from_arrays(time_s, inputs=inputs)
    seen = fid.simulate(model, flown, hold=hold, initial_state=START)  # type: ignore[arg-type]
    result = fid.verify(
        model,
        seen,
        initial_state="estimate",
        hold=hold,  # type: ignore[arg-type]
        state_bias=False,
        output_bias=False,
    )
    assert result.predictions[0].shifts.e_folds > 5.0
    for name, error in result.rms_error.items():
        assert_close(error / np.std(seen[name]), 0.0, atol=1e-12, why="the same run")


def test_a_model_of_growing_modes_alone() -> None:
    model = LinearSystem([[0.9]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    time_s = STEP_S * np.arange(500)
    # Of all solutions the one that does not grow: (0.9 + s)^-1 of the input seen backward.
    bounded = -(0.9 * np.sin(time_s) + np.cos(time_s)) / (0.9**2 + 1)
    seen = fid.Record.from_arrays(time_s, inputs={"u": np.sin(time_s)}, outputs={"y": bounded})
    result = fid.verify(model, seen, initial_state="estimate", state_bias=False, output_bias=False)
    assert_close(result.rms_error["y"], 0.0, atol=2e-5, why="straight lines of a sine")


def test_the_swap_test_counts_all_patterns() -> None:
    drawn = np.random.default_rng(5).standard_normal(8) + 0.5
    sums = [abs(np.dot(signs, drawn)) for signs in product((1, -1), repeat=8)]
    expected = np.mean(np.array(sums) >= abs(drawn.sum()) - 1e-12)
    assert_close(swap_p_value(drawn), expected, rtol=1e-12, why="the definition")
    assert swap_p_value(np.zeros(8)) == 1.0


def test_equally_good_models_are_told_apart_in_five_flights_of_a_hundred() -> None:
    # Errors of the two models have the same law: e1 = c + d, e2 = c - d, as coloured noise.
    rng = np.random.default_rng(11)
    told = 0
    for _ in range(2000):
        common, apart = rng.standard_normal((2, N_STRETCHES, 8)).mean(axis=2)
        told += swap_p_value((common + apart) ** 2 - (common - apart) ** 2) <= 0.05
    # 5 % of 2000 with four binomial deviations.
    assert_close(told / 2000, 0.05, atol=0.02, why="level of the test")
