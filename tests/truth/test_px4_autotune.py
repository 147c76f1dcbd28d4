"""PX4's gain design against the polynomial identity that it solves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid import errors
from flightid.control.autopilots.px4_autotune import desired_polynomial, px4_autotune_gains
from tests.closeness import assert_close


@given(
    a1=st.floats(-1.9, -0.5),
    a2=st.floats(0.1, 0.9),
    b=st.floats(0.005, 0.1),
    rise=st.floats(0.05, 0.5),
    damping=st.floats(0, 1),
)
def test_gains_solve_the_diophantine_equation(
    a1: float, a2: float, b: float, rise: float, damping: float
) -> None:
    # P = (1 − z⁻¹) A E + z⁻² F with E = 1 + e1 z⁻¹; the gains hold F, E and the weight alone.
    dt, weight = 0.01, 0.7
    gains = px4_autotune_gains(
        [0.0, b, b], [1.0, a1, a2], dt, rise_time_s=rise, damping=damping, detuning=weight
    )
    p1, p2 = desired_polynomial(dt, rise, damping)
    e1 = p1 - a1 + 1
    scale = gains.kc * (weight + (1 + e1) * 2 * b)
    f2 = gains.kd / dt * scale
    f1 = -scale - 2 * f2
    f0 = gains.ki * 5 * dt * scale - f1 - f2
    plant = np.polymul([1.0, -1.0], [1.0, a1, a2])
    total = np.polyadd(np.polymul(plant, [1.0, e1]), [0, 0, f0, f1, f2])
    assert_close(total, [1.0, p1, p2, 0.0, 0.0], atol=1e-9, why="PX4's law is this identity")


def test_desired_poles_are_critically_damped_or_butterworth() -> None:
    p1, p2 = desired_polynomial(0.01, 0.2, 0.0)
    assert_close(np.roots([1, p1, p2]).real, [math.exp(-0.1)] * 2, atol=1e-7, why="e^(−2ρ) twice")
    roots = np.log(np.roots([1.0, *desired_polynomial(0.01, 0.2, 1.0)])) / 0.01
    assert_close(-roots[0].real / abs(roots[0]), math.sqrt(0.5), atol=0.02, why="μ = 0.51, not 0.5")


def test_detuning_changes_the_gain_alone() -> None:
    model = ([0.0, 0.02, 0.02], [1.0, -1.8, 0.81], 0.02)
    soft, hard = (px4_autotune_gains(*model, detuning=w) for w in (2.0, 0.5))
    assert soft.kc < hard.kc
    assert (soft.ki, soft.kd) == (hard.ki, hard.kd)


def test_parameters_carry_the_ideal_form_into_the_parallel_one() -> None:
    gains = px4_autotune_gains([0.0, 0.02, 0.02], [1.0, -1.8, 0.81], 0.02)
    found = gains.parameters("roll")
    assert_close(found["MC_ROLLRATE_I"], gains.kc * gains.ki, rtol=1e-12, why="I = kc ki")
    assert_close(found["MC_ROLLRATE_D"], gains.kc * gains.kd, rtol=1e-12, why="D = kc kd")
    assert (found["MC_ROLLRATE_K"], found["MC_ROLLRATE_P"]) == (1.0, gains.kc)
    angle = min(max(1 / (math.radians(60) * gains.kc), 2.0), 6.5)
    assert_close(found["MC_ROLL_P"], angle, rtol=1e-12, why="1/(60° kc) in 2…6.5")


def test_a_model_without_gain_is_not_acceptable() -> None:
    assert not px4_autotune_gains([0.0, 0.0, 0.0], [1, -1.9, 0.9], 0.02, detuning=0.0).acceptable


def test_refuses_what_it_cannot_use() -> None:
    with pytest.raises(errors.ShapeError, match="order two"):
        px4_autotune_gains([1.0], [1.0, 0.0, 0.0], 0.01)
    with pytest.raises(errors.OptionError, match="autotune cannot use"):
        px4_autotune_gains([1.0] * 3, [2.0, 0.0, 0.0], 0.01)
