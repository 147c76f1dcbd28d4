"""Linear systems: sampling, delays as states, selection, and where they come from."""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid import errors
from flightid.models import linear_system
from flightid.models.linear.delay_states import pade_delay
from tests.closeness import assert_close
from tests.examples import examples


def _random(seed: int, *, delays: bool = True) -> fid.LinearSystem:
    random = np.random.default_rng(seed)
    n, m, p = random.integers(1, 5), random.integers(1, 3), random.integers(1, 3)
    a = random.standard_normal((n, n)) - 2.0 * np.eye(n)
    late = random.uniform(0.0, 0.3, m) * (random.uniform(size=m) < 0.7) if delays else ()
    return fid.LinearSystem(
        a,
        random.standard_normal((n, m)),
        random.standard_normal((p, n)),
        random.standard_normal((p, m)),
        tuple(f"u{k}" for k in range(m)),
        tuple(f"y{k}" for k in range(p)),
        late,
    )


@examples(60)
@given(st.integers(0, 10**6), st.sampled_from(["zero", "first"]))
def test_sampled_runs_as_the_continuous_system(seed: int, hold: str) -> None:
    system = _random(seed)
    step = 0.07
    random = np.random.default_rng(seed + 1)
    inputs = {name: random.standard_normal(60) for name in system.inputs}
    for row in inputs.values():
        row[:12] = 0.0  # at rest before, so that no past of the inputs is missing
    record = fid.Record.from_arrays(np.arange(60) * step, inputs=inputs)
    exact = fid.simulate(system, record, hold=hold)
    again = fid.simulate(system.sampled(step, hold), record)
    for name in system.outputs:
        assert_close(again[name], exact[name], rtol=1e-10, atol=1e-12, why="both are exact")


@examples(40)
@given(st.integers(0, 10**6))
def test_agrees_with_python_control(seed: int) -> None:
    system = _random(seed, delays=False)
    a, b, c, d, _ = system.state_space()
    theirs = control.ss(a, b, c, d)
    omega = np.geomspace(0.1, 30.0, 7)
    peer = theirs(1j * omega, squeeze=False)
    assert_close(system.frequency_response(omega), peer, rtol=1e-10, why="same matrices")
    sampled = control.sample_system(theirs, 0.05, method="zoh")
    ours = system.sampled(0.05)
    peer = sampled(np.exp(1j * omega * 0.05), squeeze=False)
    assert_close(ours.frequency_response(omega), peer, rtol=1e-9, atol=1e-12, why="exact hold")
    assert system.is_stable == bool(np.all(theirs.poles().real < 0))


def test_delay_is_exact_in_frequency_and_close_as_states() -> None:
    late = fid.LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.5]], ("u",), ("y",), [0.13])
    omega = np.array([0.5, 3.0, 12.0])
    exact = (0.5 + 5.0 / (1j * omega + 5.0)) * np.exp(-0.13j * omega)
    assert_close(late.frequency_response(omega)[0, 0], exact, rtol=1e-13, why="formula")
    for order, tolerance in ((1, 0.3), (2, 0.02), (4, 2e-5)):
        near = late.with_pade(order).frequency_response(omega)[0, 0]
        assert_close(near, exact, rtol=tolerance, why="Padé")
    with pytest.raises(AssertionError):
        assert_close(late.with_pade(2).frequency_response(omega)[0, 0], exact, rtol=1e-5, why="no")


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_pade_is_that_of_python_control(order: int) -> None:
    above, below = control.pade(0.3, order)
    ours = pade_delay(0.3, order)
    assert_close(ours[0] / ours[1][0], above, rtol=1e-12, why="same formula")
    assert_close(ours[1] / ours[1][0], below, rtol=1e-12, why="same formula")


def test_whole_delays_of_a_sampled_system_become_registers() -> None:
    late = fid.LinearSystem(
        [[0.5]],
        [[1.0, 2.0]],
        [[1.0]],
        [[0.3, 0.0]],
        ("u", "v"),
        ("y",),
        [0.2, 0.0],
        sample_time_s=0.1,
    )
    whole = late.with_pade()
    omega = np.array([0.3, 5.0, 20.0])
    assert whole.order == 3
    assert whole.states == ("x1", "delay1", "delay2")
    ours, theirs = whole.frequency_response(omega), late.frequency_response(omega)
    assert_close(ours, theirs, rtol=1e-12, why="the same delay")
    assert fid.LinearSystem([[0.5]], [[1.0]], [[1.0]], [[0.0]], "u", "y").with_pade().order == 1


def test_every_kind_of_model_gives_one() -> None:
    omega = np.array([0.7, 3.0])
    polynomial = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])
    innovations = fid.InnovationsModel(("u",), ("y",), 0.1, [[0.9]], [[1.0]], [[1.0]])
    for model in (
        fid.load_model("rate_first_order"),
        fid.load_model("r50_hover"),
        polynomial,
        innovations,
    ):
        system = model.linear_system()
        assert system.linear_system() is system
        found, wanted = system.frequency_response(omega), model.frequency_response(omega)
        assert_close(found, wanted, rtol=1e-9, atol=1e-12, why=type(model).__name__)
    assert fid.load_model("r50_hover").linear_system().states[:2] == ("u", "v")
    with pytest.raises(errors.ModelError, match="no linear system"):
        linear_system("roll")


def test_selection_keeps_order_and_delays() -> None:
    system = _random(7)
    chosen = system.select(outputs=system.outputs[::-1], inputs=system.inputs[-1:])
    omega = np.array([1.0, 4.0])
    whole = system.frequency_response(omega)
    wanted = whole[::-1, -1:]
    assert_close(chosen.frequency_response(omega), wanted, rtol=1e-13, why="a selection")
    with pytest.raises(errors.UnknownNameError, match="no such output"):
        system.select(outputs=["none"])
    with pytest.raises(errors.UnknownNameError, match="no such input"):
        system.select(inputs=["none"])


def test_refusals() -> None:
    one = [[1.0]]
    with pytest.raises(errors.DataError, match="a delay is negative"):
        fid.LinearSystem(one, one, one, one, ("u",), ("y",), [-0.1])
    with pytest.raises(errors.DataError, match="part of a sample"):
        fid.LinearSystem(one, one, one, one, ("u",), ("y",), [0.05], sample_time_s=0.1)
    with pytest.raises(errors.DataError, match="the sample time is not positive"):
        fid.LinearSystem(one, one, one, one, ("u",), ("y",), sample_time_s=0.0)
    with pytest.raises(errors.DataError, match="A of a system is not finite"):
        fid.LinearSystem([[np.nan]], one, one, one, ("u",), ("y",))
    with pytest.raises(errors.ShapeError, match="names of states"):
        fid.LinearSystem(one, one, one, one, ("u",), ("y",), states=("a", "b"))
    with pytest.raises(errors.DataError, match="no finite response"):
        fid.LinearSystem([[0.0]], one, one, one, ("u",), ("y",)).frequency_response([0.0])
    lag = fid.LinearSystem([[-1.0]], one, one, one, ("u",), ("y",))
    with pytest.raises(errors.OptionError, match="hold is not known"):
        lag.sampled(0.1, "second")  # type: ignore[arg-type]
    with pytest.raises(errors.OptionError, match="the sample time is not positive"):
        lag.sampled(0.0)
    with pytest.raises(errors.ModelError, match="sampled already"):
        lag.sampled(0.1).sampled(0.1)
    with pytest.raises(errors.OptionError, match="order of a Padé"):
        lag.with_pade(0)
    record = fid.Record.from_arrays(np.arange(5) * 0.2, inputs={"u": np.ones(5)})
    with pytest.raises(errors.DataError, match="another sample time"):
        fid.simulate(lag.sampled(0.1), record)
    with pytest.raises(errors.ShapeError, match="initial state"):
        fid.simulate(lag.sampled(0.2), record, initial_state=[0.0, 1.0])
    wild = fid.LinearSystem([[1e200]], one, one, one, ("u",), ("y",), sample_time_s=0.2)
    with pytest.raises(errors.DataError, match="diverges"):
        fid.simulate(wild, record)
