"""The simulated twin-rotor rig: its equations, an independent integrator, its modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flightid import _native
from flightid.errors import DataError, OptionError, ShapeError
from flightid.simulation import simulate
from flightid.vehicles import Draught, Encoders, TwinRotor, TwinRotorParameters
from tests.closeness import assert_close

CALM = Draught(moment_n_m=(0.0, 0.0))
EXACT = Encoders(step_rad=0.0, noise_rad=0.0)


def calm_rig(**changes: object) -> TwinRotor:
    return TwinRotor(replace(TwinRotorParameters(), **changes), EXACT, CALM)  # type: ignore[arg-type]


def derivative(
    rig: TwinRotor, x: NDArray[np.float64], u: NDArray[np.float64]
) -> NDArray[np.float64]:
    return _native.twin_rotor_derivative(rig.parameters.to_native(), x, u, np.zeros(2))


def trim(rig: TwinRotor) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return rig._trim_state(), np.array([rig.trim_v["u1"], rig.trim_v["u2"]])


def test_trim_is_an_equilibrium() -> None:
    x, u = trim(calm_rig())
    assert_close(derivative(calm_rig(), x, u), np.zeros(7), atol=1e-13, why="rounding")


def test_equations_at_a_hand_computed_point() -> None:
    x = np.array([0.2, 0.3, -0.1, 0.4, 0.5, -0.6, 0.02])
    found = derivative(calm_rig(), x, np.array([1.0, -3.0]))
    m1 = 0.0135 * 0.25 + 0.0924 * 0.5
    m2 = -0.02 * 0.36 - 0.09 * 0.6
    pitch = m1 - 0.32 * np.sin(0.5) - 0.0163 * np.sin(0.4) * 0.16 - 0.006 * 0.3
    pitch -= 0.001 * np.tanh(30.0) + 0.05 * m1 * 0.4 * np.cos(0.2)
    reaction = -0.2 * (1.75 * (m1 - 0.02) + 0.02)
    yaw = m2 - reaction + 0.0006 - 0.0087 * 0.4 - 0.0005 * np.tanh(40.0)
    motors = [(1.1 - 0.5) / 1.1, 0.8 * -2.5 + 0.6]
    expected = [0.3, pitch / 0.068, 0.4, yaw / 0.02, *motors, (m1 - 0.02) / 2.0]
    assert_close(found, np.array(expected), rtol=1e-13, why="the same formulas, rounding")


def test_run_agrees_with_an_independent_integrator() -> None:
    rig, n, step_s = calm_rig(), 80, 0.1
    rng = np.random.default_rng(4)
    moves = {"u1": rng.uniform(-0.5, 0.5, n), "u2": rng.uniform(-0.5, 0.5, n)}
    record = rig.run(moves, sample_time_s=step_s)
    x, base = trim(rig)
    angles = []
    for k in range(n):
        angles.append(x[[0, 2]])
        u = base + np.array([moves["u1"][k], moves["u2"][k]])
        x = solve_ivp(
            lambda _, s, u=u: derivative(rig, s, u), (0, step_s), x, "DOP853", rtol=1e-9, atol=1e-11
        ).y[:, -1]
    assert_close(record.matrix(["y1", "y2"]), np.array(angles).T, atol=1e-6, why="RK4 at 5 ms")


def test_small_motion_follows_the_linearised_rig() -> None:
    rig = calm_rig(coulomb_friction_n_m=(0.0, 0.0))
    size = 1e-5
    u = size * np.sign(np.sin(np.arange(300) * 0.21))
    flown = rig.run({"u1": u, "u2": -u[::-1]})
    moves = flown.replace({key: flown[key] - rig.trim_v[key] for key in ("u1", "u2")})
    linear = simulate(rig.linearised(), moves, hold="zero")
    for output in ("y1", "y2"):
        scale = float(np.max(np.abs(flown[output])))
        assert_close(linear[output], flown[output], atol=2e-4 * scale, why="terms of second order")


def test_modes_are_those_reported_for_the_rig() -> None:
    poles = np.linalg.eigvals(TwinRotor().linearised().state_space()[0])
    pitch, yaw = sorted((p for p in poles if p.imag > 0), key=lambda p: -abs(p))
    assert_close(abs(pitch) / (2 * np.pi), 0.34, atol=0.005, why="published to two digits")
    z = 0.9773 + 0.0492j  # equation (5) of the study, 10 Hz
    assert_close(abs(yaw), abs(np.log(z)) * 10, rtol=0.01, why="stiffness was chosen for it")
    assert_close(-yaw.real, -np.log(abs(z)) * 10, rtol=0.01, why="friction was chosen for it")


def test_locked_rig_does_not_yaw() -> None:
    record = calm_rig().locked().run({"u1": np.full(100, 0.3)})
    assert not np.any(record["y2"])
    assert float(np.ptp(record["y1"])) > 0.1


def test_encoders_count_and_seeds_repeat() -> None:
    rig = TwinRotor()
    first, again, other = (rig.run({"u1": np.zeros(200)}, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first["y1"], again["y1"])
    assert not np.array_equal(first["y1"], other["y1"])
    counts = first["y1"] / rig.encoders.step_rad
    assert_close(counts, np.round(counts), atol=1e-9, why="whole counts")
    assert float(np.max(np.abs(first["y1"] - first["pitch"]))) < 0.0016


def test_draught_has_the_variance_asked_for() -> None:
    # A beam with nothing but a strong spring follows slow moments: pitch = moment / stiffness.
    rig = TwinRotor(
        replace(TwinRotorParameters(), viscous_friction_n_m_s=(2.0, 0.1)),
        EXACT,
        Draught(moment_n_m=(0.002, 0.0), time_s=60.0),
    )
    angles = [rig.run({"u1": np.zeros(400)}, seed=seed)["pitch"][-1] for seed in range(60)]
    expected = 0.002 / (0.32 * np.cos(0.3))
    assert_close(np.std(angles), expected, rtol=0.25, why="60 draws: 9 % each sigma")


@pytest.mark.parametrize(
    ("inputs", "error", "words"),
    [
        ({}, OptionError, "the rig has two inputs"),
        ({"u3": np.zeros(5)}, OptionError, "the rig has two inputs"),
        ({"u1": np.zeros(5), "u2": np.zeros(6)}, ShapeError, "inputs differ in length"),
        ({"u1": np.array([0.0, np.nan])}, DataError, "finite"),
    ],
)
def test_bad_inputs(inputs: dict[str, object], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        TwinRotor().run(inputs)  # type: ignore[arg-type]


def test_bad_settings() -> None:
    with pytest.raises(OptionError, match="sample_time_s has no meaning"):
        TwinRotor().run({"u1": np.zeros(5)}, sample_time_s=0.0)
    with pytest.raises(OptionError, match="motor_lag_s has no meaning"):
        TwinRotorParameters(motor_lag_s=(1.0, 0.0))
    with pytest.raises(OptionError, match="cannot hold the beam level"):
        TwinRotorParameters(gravity_moment_n_m=5.0)
    with pytest.raises(OptionError, match="no such error"):
        Encoders(noise_rad=-1.0)
    with pytest.raises(OptionError, match="cannot move so"):
        Draught(time_s=-1.0)
