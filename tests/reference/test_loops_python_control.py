"""Random loops against python-control: interconnect, feedback, append, c2d, time responses."""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from tests.closeness import assert_close
from tests.examples import examples

L = fid.loops
OMEGA = np.geomspace(0.05, 50.0, 25)
N = 80


def random_system(
    random: np.random.Generator, n: int, inputs: tuple[str, ...], outputs: tuple[str, ...],
    step: float | None = None, direct: float = 0.2,
) -> fid.LinearSystem:  # fmt: skip
    a = random.standard_normal((n, n))
    shift = max(np.linalg.eigvals(a).real) + 0.3
    a = a - shift * np.eye(n) if step is None else 0.9 * a / np.max(np.abs(np.linalg.eigvals(a)))
    return fid.LinearSystem(
        a, random.standard_normal((n, len(inputs))), random.standard_normal((len(outputs), n)),
        direct * random.standard_normal((len(outputs), len(inputs))), inputs, outputs,
        sample_time_s=step,
    )  # fmt: skip


def peer(system: fid.LinearSystem, name: str) -> control.StateSpace:
    a, b, c, d, _ = system.state_space()
    return control.ss(
        a, b, c, d, system.sample_time_s or 0, inputs=list(system.inputs),
        outputs=list(system.outputs), name=name,
    )  # fmt: skip


def record(signals: dict[str, np.ndarray], step: float) -> fid.Record:
    return fid.Record.from_arrays(step * np.arange(N), inputs=signals)


@examples(25)
@given(st.integers(0, 100_000), st.sampled_from([None, 0.1]))
def test_three_random_systems_in_a_circle(seed: int, step: float | None) -> None:
    random = np.random.default_rng(seed)
    systems = [
        # The peer refuses algebraic loops; `test_step_responses_of_feedback` has them.
        random_system(random, 3, ("u", "d"), ("y", "w"), step, direct=0.0),
        random_system(random, 2, ("y", "r"), ("v",), step),
        random_system(random, 1, ("v", "w"), ("u",), step),
    ]
    ours = fid.connect(systems, inputs=["r", "d"], outputs=["y", "v", "u"])
    theirs = control.interconnect(
        [peer(each, f"s{k}") for k, each in enumerate(systems)],
        inplist=["r", "d"], outlist=["y", "v", "u"], inputs=["r", "d"], outputs=["y", "v", "u"],
        warn_duplicate=False,
    )  # fmt: skip
    omega = OMEGA if step is None else OMEGA[np.pi / step > OMEGA]
    wanted = theirs(1j * omega if step is None else np.exp(1j * omega * step))
    assert_close(
        ours.frequency_response(omega), wanted, atol=1e-9 * max(np.max(np.abs(wanted)), 1.0),
        why="the same linear algebra in another order",
    )  # fmt: skip
    ours_poles, their_poles = ours.poles(), theirs.poles()
    assert len(ours_poles) == 6
    for pole in their_poles:
        assert np.min(np.abs(ours_poles - pole)) < 1e-6 * max(1.0, abs(pole))
    decay = their_poles.real < 0.0 if step is None else np.abs(their_poles) < 1.0
    assert ours.is_stable == bool(np.all(decay))


@examples(15)
@given(st.integers(0, 100_000))
def test_step_responses_of_feedback(seed: int) -> None:
    random = np.random.default_rng(seed)
    forward = random_system(random, 3, ("e",), ("y",))
    back = random_system(random, 2, ("y",), ("f",))
    loop = fid.connect([forward, back, L.sum_of("e", "r", "-f")], inputs=["r"], outputs=["y"])
    closed = control.feedback(peer(forward, "f"), peer(back, "b"))
    if np.max(closed.poles().real) > 1.0:
        return
    u = random.standard_normal(N)
    ours = loop.simulate(record({"r": u}, 0.05))
    theirs = control.forced_response(closed, 0.05 * np.arange(N), u)
    size = np.max(np.abs(theirs.outputs))
    assert_close(ours["y"], theirs.outputs, atol=1e-9 * size, why="both discretise exactly")
    held = loop.simulate(record({"r": u}, 0.05), hold="zero")["y"]
    recursion = loop.sampled(0.05)
    theirs_held = control.forced_response(control.c2d(closed, 0.05), U=u).outputs
    assert_close(held, theirs_held, atol=1e-9 * size, why="both hold exactly")
    same = fid.connect([recursion], inputs=["r"]).simulate(record({"r": u}, 0.05))["y"]
    assert_close(same, theirs_held, atol=1e-9 * size, why="the recursion of the held loop")


@examples(15)
@given(st.integers(0, 100_000))
def test_digital_control_of_a_continuous_plant(seed: int) -> None:
    random = np.random.default_rng(seed)
    step = 0.1
    plant = random_system(random, 3, ("u",), ("y",))
    controller = random_system(random, 2, ("e",), ("c",), step)
    loop = fid.connect(
        [plant, controller, L.sum_of("e", "r", "-y"), L.sample_and_hold("c", "u", step)],
        inputs=["r"], outputs=["y", "c"],
    )  # fmt: skip
    digital = control.c2d(peer(plant, "p"), step)
    closed = control.feedback(
        control.ss(controller.a, controller.b, controller.c, controller.d, step) * 1.0, digital
    )
    ours = loop.sampled()
    assert_close(
        ours.select(outputs=["c"]).frequency_response([0.3, 3.0, 20.0])[0, 0],
        closed(np.exp(1j * step * np.array([0.3, 3.0, 20.0]))), rtol=1e-7,
        why="the same recursion",
    )  # fmt: skip
    if not ours.is_stable:
        return
    u = random.standard_normal(N)
    flown = loop.simulate(record({"r": u}, step), hold="zero")
    theirs = control.forced_response(closed, U=u).outputs
    size = max(1.0, np.max(np.abs(theirs)))
    assert_close(flown["c"], theirs, atol=1e-8 * size, why="simulation of blocks and recursion")
    finer = fid.Record.from_arrays(
        step / 4 * np.arange(4 * N - 3), inputs={"r": np.repeat(u, 4)[: 4 * N - 3]}
    )
    between = loop.simulate(finer, hold="zero")
    assert_close(between["c"][::4], theirs, atol=1e-8 * size, why="finer steps change no sample")


def test_append_is_two_blocks_that_do_not_meet() -> None:
    random = np.random.default_rng(1)
    first = random_system(random, 2, ("a",), ("x",))
    second = random_system(random, 3, ("b",), ("z",))
    ours = fid.connect([first, second], inputs=["a", "b"], outputs=["x", "z"])
    theirs = control.append(peer(first, "f"), peer(second, "s"))
    assert_close(ours.frequency_response(OMEGA), theirs(1j * OMEGA), rtol=1e-9, why="no coupling")


@pytest.mark.parametrize("order", [2, 5])
def test_pade_delays_in_a_loop(order: int) -> None:
    loop = fid.connect(
        [L.transfer("e", "y", [4.0], [1.0, 1.0, 0.0], delay_s=0.2), L.sum_of("e", "r", "-y")],
        inputs=["r"], outputs=["y"],
    )  # fmt: skip
    late = control.tf(*control.pade(0.2, order))
    theirs = control.feedback(control.ss(control.tf([4.0], [1.0, 1.0, 0.0]) * late), 1)
    ours = loop.linear_system(order).with_pade(order).frequency_response(OMEGA)[0, 0]
    assert_close(ours, theirs(1j * OMEGA), rtol=1e-8, why="the same approximation")
