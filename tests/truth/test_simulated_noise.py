"""Statistics of simulated noise against the Lyapunov equation, seeds and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

import flightid as fid
from flightid.errors import ModelError, OptionError, UnknownNameError
from flightid.simulation.noise import sampled_noise
from tests.closeness import assert_close

A = np.array([[-1.0, 4.0], [-3.0, -2.0]])
SYSTEM = fid.LinearSystem(A, [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)), ("u",), ("p", "q"))
STEP_S = 0.05


def quiet(n: int, step_s: float = STEP_S, names=("u",), values=None) -> fid.Record:
    inputs = {name: np.full(n, (values or {}).get(name, 0.0)) for name in names}
    return fid.Record.from_arrays(np.arange(n) * step_s, inputs=inputs)


@pytest.mark.parametrize("step_s", [0.001, 0.1, 3.0, 200.0])
def test_the_covariance_of_a_sample_keeps_the_steady_one(step_s: float) -> None:
    density = np.array([[2.0, 0.3], [0.3, 0.5]])
    steady = solve_continuous_lyapunov(A, -density)
    transition, covariance = sampled_noise(A, density, step_s)
    kept = transition @ steady @ transition.T + covariance
    assert_close(kept, steady, rtol=1e-11, why="Lyapunov: the steady covariance stays")


def test_fast_modes_do_not_overflow() -> None:
    fast = np.diag([-1e5, -1.0])
    _, covariance = sampled_noise(fast, np.eye(2), 1.0)
    wanted = np.array([0.5e-5, 0.5 * (1.0 - np.exp(-2.0))])
    assert_close(np.diag(covariance), wanted, rtol=1e-9, why="closed form of two lags")


def within(found: float, wanted: float, share: float) -> None:
    assert abs(found / wanted - 1.0) < share, f"{found} against {wanted}"


def test_process_noise_has_the_lyapunov_covariance() -> None:
    noise = fid.Noise(process={"x1": 0.5, "x2": 1.5}, seed=2)
    wanted = solve_continuous_lyapunov(A, -np.diag([0.25, 2.25]))
    made = fid.simulate(SYSTEM, quiet(200_000), noise=noise).matrix(("p", "q"))[:, 200:]
    found = np.cov(made)
    # About 1.5 e^-t per lag: 10 000 s hold some 10 000 independent samples.
    for i, j in ((0, 0), (1, 1), (0, 1)):
        assert abs(found[i, j] - wanted[i, j]) < 0.05 * np.sqrt(wanted[i, i] * wanted[j, j])


def test_gusts_have_their_size_and_act_through_the_air() -> None:
    noise = fid.Noise(gusts={"x2": (0.8, 2.0)}, seed=4)
    whole = np.block([[A, -A[:, [1]]], [np.zeros((1, 2)), np.array([[-0.5]])]])
    density = np.diag([0.0, 0.0, 2 * 0.8**2 / 2.0])
    wanted = solve_continuous_lyapunov(whole, -density)
    assert_close(wanted[2, 2], 0.64, rtol=1e-12, why="the gust's own variance")
    made = fid.simulate(SYSTEM, quiet(200_000), noise=noise).matrix(("p", "q"))[:, 200:]
    for k in range(2):
        within(np.var(made[k]), wanted[k, k], 0.06)


def test_a_sampled_system_takes_deviations_a_sample() -> None:
    sampled = SYSTEM.sampled(STEP_S)
    noise = fid.Noise(process={"x1": 0.1, "x2": 0.2}, seed=1)
    wanted = solve_discrete_lyapunov(np.asarray(sampled.a), np.diag([0.01, 0.04]))
    made = fid.simulate(sampled, quiet(100_000), noise=noise).matrix(("p", "q"))[:, 200:]
    for k in range(2):
        within(np.var(made[k]), wanted[k, k], 0.06)
    with pytest.raises(OptionError, match="gusts need the rates"):
        fid.simulate(sampled, quiet(10), noise=fid.Noise(gusts={"x1": (1.0, 1.0)}))


def test_sensor_noise_is_white_and_alone() -> None:
    noise = fid.Noise(sensor={"q": 0.3}, seed=7)
    made = fid.simulate(SYSTEM, quiet(20_000), noise=noise)
    assert np.all(made["p"] == 0.0)
    within(np.std(made["q"]), 0.3, 0.02)
    assert abs(np.corrcoef(made["q"][1:], made["q"][:-1])[0, 1]) < 0.02


def test_kinds_of_noise_have_their_own_streams() -> None:
    record = quiet(50)
    one = fid.simulate(SYSTEM, record, noise=fid.Noise(sensor={"p": 0.1}, seed=3))
    both = fid.simulate(
        SYSTEM, record, noise=fid.Noise(sensor={"p": 0.1}, process={"x1": 1.0}, seed=3)
    )
    alone = fid.simulate(SYSTEM, record, noise=fid.Noise(process={"x1": 1.0}, seed=3))
    assert_close(both["p"], one["p"] + alone["p"], atol=1e-14, why="the same draws, added")
    again = fid.simulate(SYSTEM, record, noise=fid.Noise(sensor={"p": 0.1}, seed=3))
    assert np.array_equal(one["p"], again["p"])
    other = fid.simulate(SYSTEM, record, noise=fid.Noise(sensor={"p": 0.1}, seed=4))
    assert not np.array_equal(one["p"], other["p"])
    assert "noise" in one.history[-1].options


def roll(stiffening: float) -> fid.StateSpaceModel:
    return fid.StateSpaceModel.from_dict({
        "states": {"p": "rad/s", "phi": "rad"}, "inputs": {"u": "1"},
        "outputs": {"p": "p", "pdot": {"expression": "p'", "unit": "rad/s^2"}},
        "parameters": {"L": {"value": -2.0, "unit": "1/s"}, "K": {"value": 3.0, "unit": "1/s^2"},
                       "c": {"value": stiffening, "unit": "1/s^2"},
                       "g": {"value": 1.0, "unit": "rad/s^2"}},
        "equations": {"p'": "L*p - K*phi - c*phi^3 + g*u", "phi'": "p"},
    })  # fmt: skip


def test_nonlinear_noise_is_that_of_the_linear_model_for_small_motion() -> None:
    linear = roll(0.0)
    a = linear.state_space()[0]
    for noise, density in (
        (fid.Noise(process={"p": 0.01}, seed=5), np.diag([1e-4, 0.0])),
        (fid.Noise(gusts={"p": (0.01, 1.5)}, seed=5), None),
    ):
        made = fid.simulate(roll(1e-3), quiet(40_000), noise=noise)["p"][200:]
        beside = fid.simulate(linear, quiet(40_000), noise=noise)["p"][200:]
        within(np.var(made), np.var(beside), 0.1)
        if density is not None:
            within(np.var(made), solve_continuous_lyapunov(a, -density)[0, 0], 0.1)


def test_accelerations_feel_the_gust() -> None:
    noise = fid.Noise(gusts={"p": (0.5, 1.5)}, seed=5)
    made = fid.simulate(roll(0.0), quiet(4000, 0.01), noise=noise)
    slope = np.gradient(made["p"], 0.01)
    share = np.corrcoef(slope[10:-10], made["pdot"][10:-10])[0, 1]
    assert share > 0.99


def test_what_noise_cannot_be() -> None:
    with pytest.raises(OptionError, match="sensor noise of p has no meaning"):
        fid.Noise(sensor={"p": -1.0})
    with pytest.raises(OptionError, match="no correlation time"):
        fid.Noise(gusts={"p": (1.0, 0.0)})
    with pytest.raises(OptionError, match="seed is too small"):
        fid.Noise(seed=-1)
    for noise in (fid.Noise(process={"z": 1.0}), fid.Noise(gusts={"z": (1.0, 1.0)})):
        with pytest.raises(UnknownNameError, match="unknown state"):
            fid.simulate(SYSTEM, quiet(10), noise=noise)
        with pytest.raises(UnknownNameError, match="unknown state"):
            fid.simulate(roll(1.0), quiet(10), noise=noise)
    with pytest.raises(UnknownNameError, match="unknown output"):
        fid.simulate(SYSTEM, quiet(10), noise=fid.Noise(sensor={"z": 1.0}))
    taken = fid.StateSpaceModel.from_dict({
        "states": {"x": "1"}, "inputs": {"noise_x": "1"}, "outputs": {"x": "x"},
        "parameters": {"k": {"value": 1.0, "unit": "1/s"}},
        "equations": {"x'": "k*noise_x - k*x^3"},
    })  # fmt: skip
    with pytest.raises(ModelError, match="name that the noise needs is taken"):
        fid.simulate(taken, quiet(10, names=("noise_x",)), noise=fid.Noise(process={"x": 1.0}))
