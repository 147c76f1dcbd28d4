"""The simulated quadrotor against mechanics: conservation, trim, linearisation, exact response."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flightid import _native
from flightid.simulation import simulate
from flightid.vehicles import (
    Autopilot,
    Flight,
    QuadrotorParameters,
    Sensors,
    SidActivation,
    Turbulence,
    fly,
    rate_truth,
)
from tests.closeness import assert_close

STILL_AIR = Turbulence(velocity_m_s=0.0, rate_rad_s=0.0)
PERFECT = Sensors(0.0, (0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0))
SMOOTH = Autopilot(pwm_step_us=0.0)
FREE = replace(
    QuadrotorParameters(), on_rig=False, axial_damping_n_s_m=0.0, in_plane_drag_n_s_m=0.0
)
AXES = ("roll", "pitch", "yaw")
LETTERS = {
    "roll": ("tau_phi", "p", "x"),
    "pitch": ("tau_theta", "q", "y"),
    "yaw": ("tau_psi", "r", "z"),
}


def _state(
    rates: tuple[float, ...], thrust: tuple[float, ...], velocity=(0.0, 0.0, 0.0)
) -> np.ndarray:
    return np.r_[np.zeros(3), velocity, 1.0, np.zeros(3), rates, thrust]


def _rotation(states: np.ndarray) -> np.ndarray:
    w, x, y, z = states[:, 6:10].T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def test_torque_free_tumbling_keeps_energy_and_momentum() -> None:
    body = replace(FREE, rotor_inertia_kg_m2=0.0)
    start = _state((3.0, -2.0, 5.0), (0.0,) * 4, (1.0, 2.0, -3.0))
    states = _native.quadrotor_trajectory(body.to_native(), start, np.zeros(4), 1e-3, 3000)
    inertia = np.array(body.inertia_kg_m2)
    omega, rotation = states[:, 10:13], _rotation(states)
    spin = 0.5 * (omega**2 @ inertia)
    assert_close(spin, spin[0], rtol=1e-9, why="no torque does work")
    momentum = np.einsum("kij,kj->ki", rotation, omega * inertia)
    assert_close(momentum, momentum[:1].repeat(3001, 0), atol=1e-9, why="no external torque")
    total = 0.5 * (states[:, 3:6] ** 2).sum(axis=1) - 9.80665 * states[:, 2]
    assert_close(total, total[0], atol=1e-7, why="falling trades height for speed")


def test_rotors_and_body_exchange_momentum() -> None:
    # Diagonal pairs at different thrust: momentum along z without roll or pitch moment.
    body = replace(FREE, torque_per_thrust_m=0.0)
    thrust = np.array([5.0, 5.0, 2.0, 2.0])
    start = _state((1.0, 0.5, -0.2), tuple(thrust))
    states = _native.quadrotor_trajectory(body.to_native(), start, thrust[::-1].copy(), 1e-3, 2000)
    speed = np.sqrt(states[:, 13:] / body.thrust_per_speed_n_s2)
    rotors = -body.rotor_inertia_kg_m2 * speed @ [1.0, 1.0, -1.0, -1.0]
    momentum = states[:, 10:13] * np.array(body.inertia_kg_m2)
    momentum[:, 2] += rotors
    earth = np.einsum("kij,kj->ki", _rotation(states), momentum)
    assert np.ptp(rotors) > 0.01
    assert_close(
        earth, earth[:1].repeat(2001, 0), atol=1e-8, why="body and rotors together are free"
    )


@pytest.mark.parametrize("on_rig", [True, False])
def test_hover_is_a_trim(on_rig: bool) -> None:
    body = replace(QuadrotorParameters(), on_rig=on_rig)
    each = np.full(4, body.hover_throttle * body.maximum_thrust_n)
    slope = _native.quadrotor_derivative(body.to_native(), _state((0.0,) * 3, tuple(each)), each)
    assert_close(slope, np.zeros(17), atol=1e-12, why="hover")


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("on_rig", [True, False])
def test_differences_of_the_equations_give_the_analytic_derivatives(
    axis: str, on_rig: bool
) -> None:
    body = replace(QuadrotorParameters(), on_rig=on_rig, rotor_height_m=0.03)
    truth = rate_truth(axis, body)
    index = AXES.index(axis)
    each = np.full(4, body.hover_throttle * body.maximum_thrust_n)
    hover = _state((0.0,) * 3, tuple(each))
    factors = np.array([[-0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0.5, 0.5, -0.5], [-0.5, -0.5, -0.5]])
    pattern = factors[:, index] * body.maximum_thrust_n

    def slope(state: np.ndarray, command: np.ndarray) -> np.ndarray:
        return _native.quadrotor_derivative(body.to_native(), state, command)

    step = 1e-4
    spun, tilted = hover.copy(), hover.copy()
    spun[10 + index] = step
    tilted[13:] += step * pattern
    damping = (slope(spun, each) - slope(hover, each))[10 + index] / step
    effect = (slope(tilted, each + step * pattern) - slope(hover, each))[10 + index] / step
    pushed = (slope(hover, each + step * pattern) - slope(hover, each))[10 + index] / step
    assert_close(damping, truth.damping_1_s, rtol=1e-9, why="linear in the rate")
    assert_close(effect, truth.gain_rad_s2, rtol=1e-6, why="linear in thrust, rotors steady")
    lead = truth.gain_rad_s2 * truth.lead_s / truth.motor_lag_s
    assert_close(pushed, lead, rtol=1e-5, atol=1e-9, why="rotors speeding up")
    assert truth.exact == (on_rig or axis == "yaw")


def _sweep(axis: str, magnitude: float, **options: object) -> Flight:
    run = SidActivation(10 + AXES.index(axis), 1.0, magnitude, 0.5, 12.0, 2.0, 30.0, 1.0)
    settings = {"sensors": PERFECT, "turbulence": STILL_AIR, "autopilot": SMOOTH} | options
    return fly(runs=[run], **settings)


@pytest.mark.parametrize(("axis", "tolerance"), [("roll", 1e-8), ("pitch", 1e-8), ("yaw", 2e-3)])
def test_flight_follows_its_truth(axis: str, tolerance: float) -> None:
    flight = _sweep(axis, 0.1)
    command, rate, _ = LETTERS[axis]
    predicted = simulate(flight.truth(axis).system(), flight.record(), hold="zero")[rate]
    size = np.abs(flight[rate]).max()
    # Rotor speed goes with the root of thrust, so yaw is linear to second order only.
    assert_close(predicted, flight[rate], atol=tolerance * size, why="the truth is exact")
    assert np.abs(flight[command]).max() > 0.05


def test_battery_and_thrust_curve_leave_the_truth_alone() -> None:
    low = replace(SMOOTH, voltage_ratio=0.85)
    predicted = []
    for loop in (SMOOTH, low):
        flight = _sweep("roll", 0.1, autopilot=loop)
        predicted.append(flight["p"])
        assert flight["limited"].max() == 0
    assert_close(predicted[0], predicted[1], atol=1e-6, why="the mixer compensates the voltage")


@pytest.mark.parametrize("gyro", ["filtered", "mean", "raw"])
def test_sampled_response_is_exact_for_each_gyro_signal(gyro: str) -> None:
    # A sweep that starts and ends at rest has no leakage: the ratio of transforms is the response.
    flight = _sweep("roll", 0.1)
    record = flight.record(gyro=gyro)
    omega = 2 * np.pi * np.array([0.8, 2.0, 5.0, 9.0])
    kernel = np.exp(-1j * np.outer(omega, record.time_s))
    ratio = (kernel @ record["p"]) / (kernel @ record["tau_phi"])
    truth = flight.truth("roll")
    assert_close(ratio, truth.frequency_response(omega, gyro), rtol=2e-4, why="rest at both ends")
    continuous = truth.continuous(omega, gyro)
    assert_close(ratio, continuous, rtol=4e-3, why="hold and filter act as a delay below 9 Hz")


def test_truth_speaks_the_templates_language() -> None:
    truth = rate_truth("pitch")
    values = truth.to_dict()
    assert values["schema"] == "flightid.rate_truth/1"
    half_loop = 0.5 * truth.sample_time_s
    assert truth.effective_delay_s("raw") == pytest.approx(truth.motor_delay_s + half_loop)
    assert truth.effective_delay_s("mean") == pytest.approx(truth.motor_delay_s + 2 * half_loop)
