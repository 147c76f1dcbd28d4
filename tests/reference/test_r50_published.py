"""The published R-50 models: eigenvalues, responses, stiffnesses; and a peer for the algebra."""

from __future__ import annotations

import control
import numpy as np
import pytest

import flightid as fid
from tests.closeness import assert_close

# Four computed digits of each mode, and the published table (real, imaginary).
HOVER = [0.3061 + 0.0939j, -0.4007 + 0.0862j, -0.6078, -1.6977 + 8.1887j, -6.1981 + 8.1967j]
HOVER += [-2.6605 + 11.5571j, -20.3125 + 4.7429j]
HOVER_PUBLISHED = [0.306 + 0.094j, -0.401 + 0.086j, -0.608, -1.7 + 8.19j, -6.2 + 8.2j]
HOVER_PUBLISHED += [-2.66 + 11.6j, -20.2 + 4.7j]
CRUISE = [-0.122, -0.9601, -1.8369, -2.3231 + 8.7891j, -5.0041 + 8.1271j, -3.3924 + 12.4225j]
CRUISE += [-27.0721 + 7.0237j, 0.0]
CRUISE_PUBLISHED = [-0.122, -0.96, -1.84, -2.32 + 8.79j, -5.0 + 8.13j, -3.4 + 12.4j, -27.04 + 7.02j]

# rad/s: dB, degrees.
ROLL = {1: (0.34, 0.64), 5: (4.07, 14.32), 8: (10.02, 13.47), 10: (14.03, -20.20)}
ROLL |= {12: (14.73, -64.10), 15: (10.11, -109.63), 20: (3.29, -133.79)}
PITCH = {5: (4.47, 175.22), 8: (10.27, 120.10), 12: (-0.17, 52.75)}


@pytest.mark.parametrize(
    ("name", "modes", "tolerance"),
    [
        ("r50_hover", HOVER, 3e-4),
        ("r50_hover", HOVER_PUBLISHED, 1e-2),
        ("r50_cruise", CRUISE, 1e-3),
        ("r50_cruise", CRUISE_PUBLISHED, 1e-2),
    ],
)
def test_eigenvalues(name: str, modes: list[complex], tolerance: float) -> None:
    found = fid.load_model(name).eigenvalues()
    for mode in modes:
        distance = np.min(np.abs(found - mode))
        assert distance <= tolerance * abs(mode) + 1e-9, f"{mode}: {distance}"


def test_rotor_stiffness() -> None:
    parameters = fid.load_model("r50_hover").parameters
    assert_close(np.sqrt(parameters["Ma"].value), 9.09, atol=0.005, why="printed digits")
    assert_close(np.sqrt(parameters["Lb"].value), 12.88, atol=0.005, why="printed digits")


@pytest.mark.parametrize(("output", "source", "points"), [("p", "lat", ROLL), ("q", "lon", PITCH)])
def test_responses_of_hover(output: str, source: str, points: dict) -> None:
    model = fid.load_model("r50_hover")
    found = model.frequency_response(list(points))
    curve = found[list(model.outputs).index(output), list(model.inputs).index(source)]
    db, degrees = np.array(list(points.values())).T
    assert_close(20 * np.log10(abs(curve)), db, atol=0.0051, why="printed digits")
    assert_close(np.degrees(np.angle(curve)), degrees, atol=0.0051, why="printed digits")


@pytest.mark.parametrize("name", ["r50_hover", "r50_cruise", "short_period", "quadrotor_yaw"])
def test_agrees_with_python_control(name: str) -> None:
    model = fid.load_model(name)
    a, b, c, d, delays = model.state_space()
    omega = np.geomspace(0.1, 100.0, 40)
    plain = control.StateSpace(a, b, c, d)(1j * omega).reshape(len(c), len(delays), len(omega))
    peer = plain * np.exp(-1j * omega * delays[:, None])
    ours = model.frequency_response(omega)
    # Pairs without a path are rounding in one and zero in the other: scale by the whole output.
    scale = np.max(np.abs(peer), axis=(1, 2), keepdims=True)
    assert_close(
        (ours - peer) / scale,
        0.0,
        atol=1e-11,
        why="the same algebra by another route",
    )


def test_cross_couplings_of_the_rig_carry_their_warning() -> None:
    model = fid.load_model("quadrotor_roll_pitch")
    assert abs(model.parameters["Mtphi"].value) > abs(model.parameters["Mttheta"].value)
    assert "implausible" in model.note


def test_damping_by_the_bars_time_constant() -> None:
    v = {name: fid.load_model("r50_hover").parameters[name].value for name in ("tau_s", "Ma", "Lb")}
    assert_close(0.5 / (v["tau_s"] * np.sqrt(v["Lb"])), 0.11, atol=0.005, why="printed digits")
    assert_close(0.5 / (v["tau_s"] * np.sqrt(v["Ma"])), 0.16, atol=0.005, why="printed digits")


@pytest.mark.parametrize(("name", "across"), [("r50_hover", 0.0), ("r50_cruise", -11.0)])
def test_accelerometers_stand_where_the_speeds_are_measured(name: str, across: float) -> None:
    model = fid.load_model(name)
    omega = np.geomspace(0.5, 30.0, 20)
    found = dict(zip(model.outputs, model.frequency_response(omega), strict=True))
    moved = 1j * omega * found["um"] + 32.2 * found["theta"] - across * found["r"]
    assert_close(moved, found["ax"], rtol=1e-9, atol=1e-9, why="the same sensor position")
