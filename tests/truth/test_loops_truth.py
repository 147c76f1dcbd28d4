"""Loops against what is known exactly: closed forms, exact delays, and integration by others."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import lambertw

import flightid as fid
from flightid.errors import OptionError, ShapeError, SingularError, UnitError, UnknownNameError
from tests.closeness import assert_close
from tests.examples import examples

L = fid.loops


def steps(values: np.ndarray | float, step: float, n: int = 200, **names: np.ndarray) -> fid.Record:
    signals = {"r": np.broadcast_to(values, n).astype(float), **names}
    return fid.Record.from_arrays(step * np.arange(n), inputs=signals)


def delayed_integrator(gain: float, delay_s: float = 0.1) -> fid.Interconnection:
    return fid.connect(
        [L.transfer("e", "y", [gain], [1.0, 0.0], delay_s=delay_s), L.sum_of("e", "r", "-y")],
        inputs=["r"], outputs=["y"],
    )  # fmt: skip


def test_a_second_order_loop_steps_as_its_formula() -> None:
    zeta, omega = 0.4, 3.0
    loop = fid.connect(
        [L.transfer("e", "v", [omega**2], [1.0, 2 * zeta * omega]),
         L.transfer("v", "y", [1.0], [1.0, 0.0]), L.sum_of("e", "r", "-y")],
        inputs=["r"], outputs=["y"],
    )  # fmt: skip
    found = loop.simulate(steps(1.0, 0.05), hold="zero")
    t, damped = found.time_s, omega * np.sqrt(1 - zeta**2)
    wave = np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t)
    assert_close(found["y"], 1 - np.exp(-zeta * omega * t) * wave, atol=1e-12,
                 why="exact discretisation")  # fmt: skip


@pytest.mark.parametrize("gain", [1.0, 3.0, 9.0, 15.0, 16.5, 60.0, 75.0, 90.0])
def test_poles_of_a_delayed_integrator_are_lamberts(gain: float) -> None:
    # s + K e^(−sτ) = 0 has the roots W_k(−Kτ)/τ.
    found = delayed_integrator(gain).stability()
    exact = np.array([lambertw(-gain * 0.1, k) / 0.1 for k in range(-30, 30)])
    for pole in found.poles:
        assert np.min(np.abs(exact - pole)) < 1e-8 * abs(pole)
    assert found.n_unstable == np.sum(exact.real > 0.0)
    assert found.is_stable == (gain < np.pi / 2 / 0.1)
    slowest = exact[np.argmax(exact.real)]
    assert_close(np.max(found.poles.real), slowest.real, rtol=1e-9, why="the deciding pole")
    assert not found.findings


def test_a_delayed_loop_steps_as_the_method_of_steps_says() -> None:
    # y' = K (1 − y(t − τ)), y = 0 before: a polynomial on each delay.
    gain, late = 4.0, 0.2
    loop = fid.connect(
        [L.sum_of("e", "r", "-y"), L.delay("e", "late", late),
         L.transfer("late", "y", [gain], [1.0, 0.0])],
        inputs=["r"], outputs=["y"],
    )  # fmt: skip

    def exact(t: float) -> float:
        # With e delayed whole, y(t) = K (t − τ) − … ; Σ (−K)^k-terms of the delayed ramps.
        return -sum(
            (-gain * max(t - k * late, 0.0)) ** k / np.prod(range(1, k + 1)) for k in range(1, 9)
        )  # fmt: skip

    errors = []
    for parts in (8, 16):
        found = loop.simulate(steps(1.0, late / parts, 6 * parts), hold="zero")
        wanted = np.array([exact(t) for t in found.time_s])
        errors.append(np.max(np.abs(found["y"] - wanted)))
    assert errors[0] < 3e-3
    assert 3.0 < errors[0] / errors[1] < 5.0, "second order in the step"


def test_a_limited_loop_agrees_with_adaptive_integration() -> None:
    # y'' = clip(6 (r − y) − 2 y', ±1), entered deep in the limit.
    loop = fid.connect(
        [L.gain(("e", "v"), "u", [[6.0, -2.0]]), L.limiter("u", "a", 1.0),
         L.transfer("a", "v", [1.0], [1.0, 0.0]), L.transfer("v", "y", [1.0], [1.0, 0.0]),
         L.sum_of("e", "r", "-y")],
        inputs=["r"], outputs=["y", "a"],
    )  # fmt: skip

    def rates(_: float, x: np.ndarray) -> list[float]:
        return [x[1], float(np.clip(6.0 * (2.0 - x[0]) - 2.0 * x[1], -1.0, 1.0))]

    t = 0.02 * np.arange(400)
    wanted = solve_ivp(rates, (0, 8.0), [0.0, 0.0], t_eval=t, rtol=1e-10, atol=1e-12, max_step=0.01)
    found = loop.simulate(steps(2.0, 0.02, 400))
    assert np.max(np.abs(found["a"])) == 1.0
    assert_close(found["y"], wanted.y[0], atol=2e-4, why="second order in steps of 20 ms")
    fine = loop.simulate(steps(2.0, 0.02, 400), maximum_step_s=0.002)
    assert_close(fine["y"], wanted.y[0], atol=1e-5, why="less at a tenth of the step")


def test_an_actuator_with_rate_limit_agrees_with_adaptive_integration() -> None:
    # x' = clip(20 (u − x), ±0.5) as lag behind a limited rate is a loop by itself.
    loop = fid.connect(
        [L.sum_of("d", "r", "-x"), L.gain("d", "want", 20.0), L.limiter("want", "rate", 0.5),
         L.transfer("rate", "x", [1.0], [1.0, 0.0]), L.rate_limiter("r", "w", 0.5)],
        inputs=["r"], outputs=["x", "w"],
    )  # fmt: skip
    t = 0.01 * np.arange(500)
    r = np.sin(2.0 * t)
    wanted = solve_ivp(
        lambda t, x: np.clip(20 * (np.sin(2 * t) - x), -0.5, 0.5), (0, 5), [0.0],
        t_eval=t, rtol=1e-9, atol=1e-11, max_step=0.005,
    )  # fmt: skip
    found = loop.simulate(steps(r, 0.01, 500))
    assert_close(found["x"], wanted.y[0], atol=1e-3, why="second order in steps of 10 ms")
    fine = loop.simulate(steps(r, 0.01, 500), maximum_step_s=0.001)
    assert_close(fine["x"], wanted.y[0], atol=2e-5, why="less at a tenth of the step")
    assert np.max(np.abs(np.diff(found["w"]))) <= 0.005 * (1 + 1e-9)


@examples(15)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.03, 0.1, 0.137]))
def test_samples_of_a_held_loop_are_those_of_its_simulation(seed: int, late: float) -> None:
    random = np.random.default_rng(seed)
    gain = random.uniform(0.2, 2.0)
    controller = L.sampled(L.lead_lag("e", "c", 0.4, 0.1), 0.1)
    loop = fid.connect(
        [L.transfer("u", "y", [gain], [1.0, 1.0, 0.0], delay_s=0.05), controller,
         L.sum_of("e", "r", "-y"), L.sample_and_hold("c", "u", 0.1, late)],
        inputs=["r"], outputs=["y", "c", "u"],
    )  # fmt: skip
    record = steps(random.standard_normal(60), 0.1, 60)
    exact = fid.connect([loop.sampled()], inputs=["r"]).simulate(record)
    found = loop.simulate(record, hold="zero")
    for name in ("y", "c"):
        assert_close(found[name], exact[name], atol=1e-9, why="both are exact at the samples")


def test_a_sampled_loop_stands_as_jurys_criterion_says() -> None:
    # 1/s held: z − 1 + K T = 0, stable for 0 < K T < 2; the fundamental alone would say otherwise.
    for gain, stable in ((1.9, True), (2.1, False)):
        loop = fid.connect(
            [L.transfer("u", "y", [1.0], [1.0, 0.0]), L.gain("e", "c", gain / 0.1),
             L.sum_of("e", "r", "-y"), L.sample_and_hold("c", "u", 0.1)],
            inputs=["r"], outputs=["y"],
        )  # fmt: skip
        assert loop.is_stable is stable
        assert_close(loop.poles(), [1.0 - gain], rtol=1e-12, why="z = 1 − K T")


def test_a_nonlinear_model_flies_in_a_loop_as_by_itself_and_by_others() -> None:
    model = fid.load_model("quadrotor_6dof")
    assert isinstance(model, fid.StateSpaceModel)
    bare = fid.connect([model], inputs=list(model.inputs), outputs=["phi", "p"])
    n, step = 1500, 0.001
    t = step * np.arange(n)
    trim = {name: float(model.trim.get(name, 0.0)) for name in model.inputs}
    moved = {name: np.zeros(n) for name in model.inputs}
    roll = next(name for name in model.inputs if "phi" in name or "roll" in name)
    moved[roll] = 0.02 * np.sin(3.0 * t)
    whole = {name: values + trim[name] for name, values in moved.items()}
    units = {name: model.units[name] for name in model.inputs}
    alone = fid.simulate(model, fid.Record.from_arrays(t, inputs=whole, units=units))
    ours = bare.simulate(fid.Record.from_arrays(t, inputs=moved, units=units))
    largest = np.max(np.abs(alone["phi"]))
    assert largest > 0.005
    assert_close(
        ours["phi"], alone["phi"], atol=2e-5 * largest,
        why="the two round the corners of a delayed input within a step of 1 ms",
    )  # fmt: skip


def test_a_nonlinear_loop_agrees_with_adaptive_integration() -> None:
    from flightid.models import Output, Parameter, Parameters  # noqa: PLC0415

    pendulum = fid.StateSpaceModel(
        states={"a": "rad", "w": "rad/s"}, input_units={"m": "1/s^2"},
        measurements={"a": Output("a", "rad"), "w": Output("w", "rad/s")},
        equations={"a'": "w", "w'": "-k*sin(a) - d*w + m"},
        parameters=Parameters([Parameter("k", 9.0, "1/s^2"), Parameter("d", 0.4, "1/s"),
                               Parameter("tau", 0.05, "s")]),
        delays={"m": "tau"}, name="pendulum",
    )  # fmt: skip
    loop = fid.connect(
        [pendulum, L.sum_of("m", "r", "-f"), L.gain(("a", "w"), "f", [[2.0, 0.5]])],
        inputs=["r"], outputs=["a"],
    )  # fmt: skip
    step = 0.05 / 8
    n = 800
    t = step * np.arange(n)
    r = 8.0 * np.sin(2.0 * t)
    units = {"r": "1/s^2"}
    found = loop.simulate(fid.Record.from_arrays(t, inputs={"r": r}, units=units))
    # An independent solver: fixed small Runge-Kutta steps with the delay as a queue.
    x, fine = np.zeros(2), 0.05 / 400
    queue = [0.0] * 401

    def rate(x: np.ndarray, m: float) -> np.ndarray:
        return np.array([x[1], -9.0 * np.sin(x[0]) - 0.4 * x[1] + m])

    kept = []
    for k in range(50 * (n - 1) + 1):
        now = 8.0 * np.sin(2.0 * k * fine) - 2.0 * x[0] - 0.5 * x[1]
        queue.append(now)
        if k % 50 == 0:
            kept.append(x[0])
        m0, m1 = queue[-401], queue[-400]
        k1 = rate(x, m0)
        k2 = rate(x + 0.5 * fine * k1, 0.5 * (m0 + m1))
        x = x + fine * k2
    assert np.max(np.abs(found["a"])) > 0.8
    assert_close(found["a"], kept, atol=1e-3, why="lines of 6 ms against 0.1 ms")


def test_states_may_begin_away_from_rest() -> None:
    loop = delayed_integrator(2.0)
    found = loop.simulate(steps(0.0, 0.01, 5), initial_state={"transfer function": [2.5]})
    assert_close(found["y"], np.full(5, 2.5), rtol=1e-12, why="the delay still holds the rest")


def test_refuses_runs_without_meaning() -> None:
    loop = delayed_integrator(2.0)
    with pytest.raises(OptionError, match="hold is not known"):
        loop.simulate(steps(1.0, 0.1), hold="cubic")
    with pytest.raises(OptionError, match="step of the simulation"):
        loop.simulate(steps(1.0, 0.1), maximum_step_s=0.0)
    with pytest.raises(UnknownNameError, match="a signal to keep is no signal"):
        loop.simulate(steps(1.0, 0.1), outputs=["q"])
    with pytest.raises(OptionError, match="belongs to no one block"):
        loop.simulate(steps(1.0, 0.1), initial_state={"q": [0.0]})
    with pytest.raises(ShapeError, match="initial state of block"):
        loop.simulate(steps(1.0, 0.1), initial_state={"transfer function": [0.0, 0.0]})
    with pytest.raises(UnknownNameError, match="no such channel"):
        loop.simulate(fid.Record.from_arrays([0.0, 0.1], inputs={"q": [0.0, 1.0]}))
    united = fid.connect([L.washout("r", "y", 1.0, units={"r": "rad"})], inputs=["r"])
    with pytest.raises(UnitError, match="another unit than the loops"):
        united.simulate(
            fid.Record.from_arrays([0.0, 0.1], inputs={"r": [0.0, 1.0]}, units={"r": "deg"})
        )
    with pytest.raises(OptionError, match="no step divides the sample times"):
        fid.connect([L.sample_and_hold("r", "y", 0.1)], inputs=["r"]).simulate(
            steps(1.0, 0.1 / np.pi)
        )
    with pytest.raises(OptionError, match="the simulation is too long"):
        loop.simulate(steps(1.0, 1.0), maximum_step_s=1e-7)
    stiff = fid.connect(
        [L.sum_of("e", "r", "-y"), L.gain("e", "u", 5.0), L.limiter("u", "y", 9.0)], inputs=["r"]
    )
    with pytest.raises(SingularError, match="algebraic loop through limits"):
        stiff.simulate(steps(1.0, 0.1))
