"""Simulation of nonlinear equations: against an independent integrator, and what it refuses."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flightid as fid
from flightid.errors import (
    DataError,
    ModelError,
    OptionError,
    ShapeError,
    SingularError,
    UnknownNameError,
)
from flightid.models import Output, Parameter, Parameters, StateSpaceModel
from flightid.models.state_space.integration_steps import steps_per_sample
from tests.closeness import assert_close

HOVER_N = 1.25 * 9.80665


def flown(seconds=4.0, rate_hz=100.0):
    """Inputs of a lively flight."""
    t = np.arange(round(seconds * rate_hz) + 1) / rate_hz
    return fid.Record.from_arrays(
        t,
        inputs={
            "F": HOVER_N + 3.0 * np.sin(2.0 * t),
            "tau_phi": 0.08 * np.sin(5.0 * t),
            "tau_theta": 0.1 * np.cos(4.0 * t),
            "tau_psi": 0.03 * np.sin(1.0 * t),
        },
        units={"F": "N", "tau_phi": "N*m", "tau_theta": "N*m", "tau_psi": "N*m"},
    )


def euler_rotation(phi, theta, psi):
    """Body to earth (x, y, down), from elementary rotations."""
    c, s = np.cos, np.sin
    about_x = np.array([[1, 0, 0], [0, c(phi), -s(phi)], [0, s(phi), c(phi)]])
    about_y = np.array([[c(theta), 0, s(theta)], [0, 1, 0], [-s(theta), 0, c(theta)]])
    about_z = np.array([[c(psi), -s(psi), 0], [s(psi), c(psi), 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def newton_euler(state, command):
    """The same vehicle by vectors and matrices instead of written-out components."""
    angles, velocity, rates = state[3:6], state[6:9], state[9:12]
    rotation = euler_rotation(*angles)
    mass, inertia = 1.25, np.diag([0.0135, 0.0138, 0.0252])
    force = np.array([-0.2, -0.2, -1.48]) * velocity - [0.0, 0.0, state[12]]
    moment = np.array([-0.102, -0.28, -0.0225]) * rates + state[13:16]
    phi, theta, _ = angles
    from_angles = np.array(
        [
            [1.0, 0.0, -np.sin(theta)],
            [0.0, np.cos(phi), np.cos(theta) * np.sin(phi)],
            [0.0, -np.sin(phi), np.cos(theta) * np.cos(phi)],
        ]
    )
    return np.concatenate(
        [
            [1.0, 1.0, -1.0] * (rotation @ velocity),
            np.linalg.solve(from_angles, rates),
            rotation.T @ [0.0, 0.0, 9.80665] + force / mass - np.cross(rates, velocity),
            np.linalg.solve(inertia, moment - np.cross(rates, inertia @ rates)),
            (command - state[12:16]) / 0.045,
        ]
    )


def test_quadrotor_agrees_with_an_independent_integration():
    model = fid.load_model("quadrotor_6dof")
    record = flown(seconds=0.15)
    found = fid.simulate(model, record, initial_state={"phi": 0.2, "u": 1.0}, substeps=8)
    stamps = record.time_s

    def command(t):
        late = t - 0.006
        return np.array([np.interp(late, stamps, record[name]) for name in model.inputs])

    start = np.zeros(16)
    start[[3, 6, 12]] = 0.2, 1.0, HOVER_N
    # The inputs have a corner in every sample interval, so the integrator must not step over one.
    path = solve_ivp(
        lambda t, x: newton_euler(x, command(t)), (0, stamps[-1]), start,
        t_eval=stamps, rtol=1e-9, atol=1e-11, max_step=0.005, method="DOP853",
    )  # fmt: skip
    for row, name in enumerate(model.outputs):
        assert_close(
            found[name],
            path.y[row],
            atol=1e-7,
            why="the integrator's own interpolation between its steps",
        )
    assert max(np.abs(found[name]).max() for name in ("phi", "theta")) > 0.15


def test_quadrotor_hovers_at_its_trim():
    model = fid.load_model("quadrotor_6dof")
    assert max(map(abs, model.residuals().values())) < 1e-12
    t = np.arange(200) * 0.02
    still = {name: np.zeros(200) for name in ("tau_phi", "tau_theta", "tau_psi")}
    record = fid.Record.from_arrays(t, inputs={"F": np.full(200, HOVER_N), **still})
    hover = fid.simulate(model, record)
    assert max(np.abs(hover[name]).max() for name in model.outputs) < 1e-11


def test_its_linearisation_is_the_linear_simulation_for_small_motion():
    model = fid.load_model("quadrotor_6dof")
    record = flown()
    names = list(model.inputs)
    small = {n: 1e-6 * (record[n] - model.trim.get(n, 0.0)) for n in names}
    whole = {n: small[n] + model.trim.get(n, 0.0) for n in names}
    nonlinear = fid.simulate(model, fid.Record.from_arrays(record.time_s, inputs=whole), substeps=4)
    matrices = fid.LinearSystem(
        *model.state_space()[:4], inputs=model.inputs, outputs=model.outputs,
        delays_s=model.state_space()[4],
    )  # fmt: skip
    linear = fid.simulate(matrices, fid.Record.from_arrays(record.time_s, inputs=small))
    for name in ("p", "q", "phi", "theta", "w", "u", "v"):
        scale = np.abs(linear[name]).max()
        assert_close(
            nonlinear[name] / scale,
            linear[name] / scale,
            atol=1e-4,
            why="products of 1e-6 of the full motion are left",
        )


def one_state(right, unit="m", **options):
    return StateSpaceModel(
        states={"x": unit}, input_units={"f": unit}, measurements={"x": Output("x", unit)},
        equations={options.pop("left", "x'"): right},
        parameters=Parameters([Parameter("k", 1.0, options.pop("k_unit", "1/s"))]), **options,
    )  # fmt: skip


def driven(n=101, dt=0.1, f=0.0):
    return fid.Record.from_arrays(np.arange(n) * dt, inputs={"f": np.full(n, f)}, units={"f": "m"})


def test_substeps_follow_the_fastest_mode_of_the_trim():
    model = fid.load_model("quadrotor_6dof")
    # The motor lag of 0.045 s is the fastest: 22.2 rad/s.
    assert [steps_per_sample(model, dt, None) for dt in (0.01, 0.02, 0.1)] == [1, 2, 9]
    assert steps_per_sample(model, 0.1, 3) == 3
    for bad in (0, 1001, 1.5):
        with pytest.raises(OptionError, match="substeps has no meaning"):
            steps_per_sample(model, 0.01, bad)
    with pytest.raises(DataError, match="too fast for the sample time"):
        steps_per_sample(model, 1000.0, None)


def test_hold_and_bias_act_on_a_nonlinear_model():
    # x' = -k sign(x) |x| ... linear in value but written nonlinearly: exact answers are known.
    model = one_state("-k*abs(x) + k*f")
    found = fid.simulate(
        model, driven(), hold="zero", substeps=20, input_bias={"f": 2.0}, output_bias={"x": 0.5},
        initial_state=[0.0],
    )  # fmt: skip
    exact = 2.0 * (1.0 - np.exp(-found.time_s)) + 0.5
    assert_close(found["x"], exact, atol=1e-9, why="Runge-Kutta with steps of 0.005 s")


def test_a_linear_model_takes_states_by_name_and_no_substeps():
    model = one_state("-k*x + k*f")
    by_name = fid.simulate(model, driven(), initial_state={"x": 1.0})
    assert_close(by_name["x"], np.exp(-by_name.time_s), atol=1e-12, why="exact exponential")
    with pytest.raises(OptionError, match="exact"):
        fid.simulate(model, driven(), substeps=2)
    lag = fid.LinearSystem([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("f",), ("x",))
    with pytest.raises(OptionError, match="states of this model have no names"):
        fid.simulate(lag, driven(), initial_state={"x": 1.0})


@pytest.mark.parametrize(
    ("state", "error", "message"),
    [
        ({"z": 1.0}, UnknownNameError, "no such state"),
        ([1.0, 2.0], ShapeError, "initial_state does not fit"),
        ([np.nan], DataError, "not finite"),
    ],
)
def test_a_start_that_does_not_fit_is_refused(state, error, message):
    with pytest.raises(error, match=message):
        fid.simulate(one_state("-k*abs(x)"), driven(), initial_state=state)


def test_runs_without_a_value_are_refused():
    growing = one_state("k*x^2", k_unit="1/(m*s)")
    with pytest.raises(DataError, match="diverges at sample"):
        fid.simulate(growing, driven(), initial_state=[1.0])
    root = one_state("-k*sqrt(x)", k_unit="m^0.5/s")
    with pytest.raises(DataError, match="diverges at sample"):
        fid.simulate(root, driven(), initial_state=[0.01])
    unitless = fid.Record.from_arrays(np.arange(9) * 0.1, inputs={"f": np.ones(9)})
    singular = one_state("k*f - k*x", left="x*x'", unit="1", k_unit="1/s")
    with pytest.raises(SingularError, match="factors of the state derivatives"):
        fid.simulate(singular, unitless, initial_state=[0.0])


def test_a_derivative_that_enters_nonlinearly_is_refused():
    squared = one_state("k*x*x'", left="x'^2", unit="m", k_unit="1/s")
    with pytest.raises(ModelError, match="does not enter its equation linearly"):
        fid.simulate(squared, driven(), initial_state=[1.0])
