"""Loops by the names of signals: what is joined, what is refused, and the identities that hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.errors import (
    DataError,
    ModelError,
    OptionError,
    ShapeError,
    UnitError,
    UnknownNameError,
)
from tests.closeness import assert_close
from tests.examples import examples

L = fid.loops
OMEGA = np.geomspace(0.1, 60.0, 40)


def feedback(gain: float = 2.0, delay_s: float = 0.0, **options: object) -> fid.Interconnection:
    plant = L.transfer("u", "y", [1.0], [1.0, 1.0, 0.0], delay_s=delay_s)
    return fid.connect(
        [plant, L.gain("e", "u", gain), L.sum_of("e", "r", "-y")], inputs=["r"], outputs=["y"]
    )


def plant(s: np.ndarray) -> np.ndarray:
    return 1 / (s * (s + 1))


def test_closed_broken_and_disturbed_loops_are_their_closed_forms() -> None:
    s = 1j * OMEGA
    loop = 2.0 * plant(s) * np.exp(-0.1 * s)
    made = feedback(2.0, 0.1)
    exact = {"rtol": 1e-10, "why": "algebra in double precision"}
    assert_close(made.frequency_response(OMEGA)[0, 0], loop / (1 + loop), **exact)
    for signal in ("y", "u", "e"):
        broken = made.broken_at(signal)
        assert (broken.inputs, broken.outputs) == ((signal,), (f"{signal}_returned",))
        assert_close(broken.frequency_response(OMEGA)[0, 0], loop, **exact)
        still = made.sensitivity_at(signal).frequency_response(OMEGA)[0, 0]
        assert_close(still, 1 / (1 + loop), **exact)
    assert_close(made.with_outputs("u").frequency_response(OMEGA)[0, 0], 2 / (1 + loop), **exact)


def test_filters_are_their_formulas() -> None:
    s = 1j * OMEGA
    zeta = np.sqrt(0.5)
    for block, wanted in (
        (L.low_pass("u", "y", 4.0), 4 / (s + 4)),
        (L.low_pass("u", "y", 4.0, 2), 16 / (s**2 + 8 * zeta * s + 16)),
        (L.high_pass("u", "y", 4.0, 2, damping=0.3), s**2 / (s**2 + 2.4 * s + 16)),
        (L.washout("u", "y", 0.5), s / (s + 0.5)),
        (L.notch("u", "y", 9.0, damping=0.2, depth=0.1),
         (s**2 + 0.36 * s + 81) / (s**2 + 3.6 * s + 81)),
        (L.lead_lag("u", "y", 0.3, 0.1), (0.3 * s + 1) / (0.1 * s + 1)),
        (L.transfer("u", "y", [2.0, 3.0], [4.0, 5.0, 6.0], delay_s=0.2),
         (2 * s + 3) / (4 * s**2 + 5 * s + 6) * np.exp(-0.2 * s)),
        (L.delay("u", "y", 0.07), np.exp(-0.07 * s)),
        (L.sample_and_hold("u", "y", 0.05, 0.01),
         (1 - np.exp(-0.05 * s)) / (0.05 * s) * np.exp(-0.01 * s)),
    ):  # fmt: skip
        found = fid.connect([block], inputs=["u"], outputs=["y"]).frequency_response(OMEGA)
        assert_close(found[0, 0], wanted, rtol=1e-11, why="the same formula")


@pytest.mark.parametrize("order", [1, 2])
def test_complementary_filters_pass_agreeing_sensors_unchanged(order: int) -> None:
    s = 1j * OMEGA
    for kind, fast in (("same", 1.0), ("rate", s)):
        block = L.complementary("a", "g", "phi", 0.7, order, fast_is=kind)
        found = fid.connect([block], inputs=["a", "g"], outputs=["phi"]).frequency_response(OMEGA)
        assert_close(found[0, 0] + fast * found[0, 1], np.ones(len(s)), rtol=1e-12,
                     why="the two shares are complements")  # fmt: skip


def test_sampled_filters_keep_what_their_rule_keeps() -> None:
    block = L.notch("u", "y", 30.0, depth=0.2)
    warped = L.sampled(block, 0.02, prewarp_rad_s=30.0)
    centre = warped.part.frequency_response([30.0])[0, 0, 0]
    assert_close(centre, 0.2, rtol=1e-12, why="the trapezoidal rule is exact where it is bent to")
    s = 2 / 0.02 * np.tanh(0.5j * 0.02 * OMEGA)
    plain = L.sampled(L.low_pass("u", "y", 4.0), 0.02).part.frequency_response(OMEGA)[0, 0]
    assert_close(plain, 4 / (s + 4), rtol=1e-11, why="s becomes 2/T (z − 1)/(z + 1)")
    exact = L.sampled(L.low_pass("u", "y", 4.0), 0.02, "zero").part
    assert_close(exact.poles(), np.exp([-0.08]), rtol=1e-13, why="step invariance")


def test_models_are_blocks_by_their_channels_and_units() -> None:
    model = fid.load_model("quadrotor_yaw")
    block = L.system(model)
    assert (block.inputs, block.outputs) == (tuple(model.inputs), tuple(model.outputs))
    assert block.units["r"] == "rad/s"
    with pytest.raises(UnitError, match=r"two units for signal 'r'.*deg/s"):
        fid.connect(
            [block, L.washout("r", "w", 1.0, units={"r": "deg/s"})], inputs=list(model.inputs)
        )
    with pytest.raises(UnitError, match="two units for signal"):
        # Filters and sums pass the unit on.
        fid.connect(
            [block, L.washout("r", "w", 1.0), L.sum_of("e", "w", "c", units={"c": "V"})],
            inputs=[*model.inputs, "c"],
        )


@pytest.mark.parametrize(
    ("blocks", "inputs", "error", "says"),
    [
        ([L.gain("x", "y", 1.0)], ["u"], UnknownNameError, "signal 'x' has no source"),
        ([L.gain("u", "y", 1.0), L.gain("u", "y", 2.0)], ["u"], ModelError, "'y' has two sources"),
        ([L.gain("u", "y", 1.0)], ["u", "y"], ModelError, "'y' has two sources"),
        ([L.gain("u", "y", 1.0)], ["u", "u"], ModelError, "given twice"),
        (
            [L.sum_of("e", "r", "y"), L.gain("e", "y", 1.0)],
            ["r"],
            ModelError,
            "algebraic loop has no solution.*gain of one around e, y",
        ),
        (
            [L.sampled(L.low_pass("u", "v", 1.0), 0.1), L.low_pass("v", "y", 1.0)],
            ["u"],
            ModelError,
            "sampled signal 'v' meets a continuous block",
        ),
        (
            [L.transfer("u", "v", [1.0], [1.0, 0.5], sample_time_s=0.1),
             L.transfer("v", "y", [1.0], [1.0, 0.5], sample_time_s=0.2)],
            ["u"],
            ModelError,
            "'v' has another sample time",
        ),
    ],
)  # fmt: skip
def test_refuses_what_cannot_be_joined(
    blocks: list[L.Block], inputs: list[str], error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        fid.connect(blocks, inputs=inputs)


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: L.sum_of("e"), OptionError, "terms of sum"),
        (lambda: L.sum_of("e", "r", "-r"), OptionError, "terms of sum"),
        (lambda: L.limiter("u", "v", 1.0, 2.0), OptionError, "limits have no meaning"),
        (lambda: L.rate_limiter("u", "v", 0.0), OptionError, "rate limit has no meaning"),
        (lambda: L.sample_and_hold("u", "v", 0.0), OptionError, "sample time has no meaning"),
        (lambda: L.sample_and_hold("u", "v", 0.1, -1.0), OptionError, "computation delay"),
        (lambda: L.delay("u", "v", -0.1), DataError, "delay is negative"),
        (lambda: L.gain("u", "v", [[1.0, 2.0]]), ShapeError, "D does not fit"),
        (lambda: L.gain("u", "v", np.nan), DataError, "not finite"),
        (lambda: L.gain("u", "", 1.0), ModelError, "has no name"),
        (lambda: L.gain("u", ("v", "v"), [[1.0], [1.0]]), ModelError, "gives a signal twice"),
        (lambda: L.gain("u", "v", 1.0, units={"w": "m"}), OptionError, "belongs to no signal"),
        (lambda: L.low_pass("u", "v", 0.0), OptionError, "corner of a filter"),
        (lambda: L.low_pass("u", "v", 1.0, 3), OptionError, "order of a filter"),
        (lambda: L.low_pass("u", "v", 1.0, 2, damping=0.0), OptionError, "damping of a filter"),
        (lambda: L.notch("u", "v", 1.0, depth=1.0), OptionError, "depth of a notch"),
        (lambda: L.lead_lag("u", "v", 0.1, 0.0), OptionError, "times of a lead-lag"),
        (lambda: L.complementary("a", "g", "v", 1.0, fast_is="x"), OptionError, "fast sensor"),
        (lambda: L.transfer("u", "v", [1.0], [0.0]), ModelError, "denominator is zero"),
        (lambda: L.transfer("u", "v", [1, 0, 0], [1, 1]), ModelError, "more zeros than poles"),
        (lambda: L.sampled(L.limiter("u", "v", 1.0), 0.1), ModelError, "cannot be sampled"),
        (lambda: L.sampled(L.washout("u", "v", 1.0), 0.1, "euler"), OptionError, "method"),
        (
            lambda: L.sampled(L.washout("u", "v", 1.0), 0.1, prewarp_rad_s=40.0),
            OptionError,
            "frequency to keep",
        ),
        (
            lambda: L.system(fid.load_model("rate_integrator"), rename={"x": "y"}),
            OptionError,
            "to rename is not there",
        ),
        (
            lambda: L.system(fid.load_model("rate_integrator"), rename={"tau": "p", "y": "p"}),
            (ModelError, OptionError),
            "one name|not there",
        ),
    ],
)
def test_refuses_blocks_without_meaning(make, error, says: str) -> None:
    with pytest.raises(error, match=says):
        make()


def test_refuses_questions_without_an_answer() -> None:
    loop = feedback(2.0, 0.1)
    with pytest.raises(UnknownNameError, match="no block gives this signal"):
        loop.broken_at("r")
    with pytest.raises(UnknownNameError, match="an output is no signal"):
        loop.with_outputs("z")
    with pytest.raises(OptionError, match="an output is given twice"):
        loop.with_outputs("y", "y")
    with pytest.raises(OptionError, match="delay inside the loops has no exact place"):
        loop.linear_system(None)
    with pytest.raises(OptionError, match="sample time is not known"):
        loop.sampled()
    parts = [L.transfer("u", "v", [1.0], [1.0, 0.0]), L.delay("v", "y", 0.1)]
    late = fid.connect([*loop.blocks[1:], *parts], inputs=["r"])
    with pytest.raises(ModelError, match="moves between the samples"):
        late.sampled(0.05)
    with pytest.raises(ModelError, match="sampled block has no place"):
        fid.connect(
            [L.transfer("u", "v", [1.0], [1.0, 0.5], sample_time_s=0.1)], inputs=["u"]
        ).linear_system()
    held = fid.connect([L.sample_and_hold("u", "v", 0.1)], inputs=["u"])
    with pytest.raises(OptionError, match="another sample time"):
        held.sampled(0.2)
    with pytest.raises(DataError, match="poles of the"):
        feedback().broken_at("y").frequency_response([0.0])


def test_delays_at_an_input_stay_exact_in_a_linear_system() -> None:
    plant = L.transfer("u", "y", [3.0], [1.0, 2.0], delay_s=0.2)
    joined = fid.connect([L.gain("r", "u", 2.0), plant], inputs=["r"], outputs=["y"])
    system = joined.linear_system(None)
    assert system.delays_s.tolist() == [0.2]
    assert_close(
        system.frequency_response(OMEGA), joined.frequency_response(OMEGA), rtol=1e-12,
        why="a gain commutes with a delay",
    )  # fmt: skip


def test_an_input_that_acts_at_once_and_late_gets_states_for_its_late_part() -> None:
    joined = fid.connect(
        [L.delay("r", "late", 0.1), L.sum_of("y", "r", "late")], inputs=["r"], outputs=["y", "r"]
    )
    slow = np.array([0.1, 1.0, 5.0])
    found = joined.linear_system(4)
    assert found.delays_s.tolist() == [0.0]
    assert_close(
        found.frequency_response(slow)[0, 0], 1 + np.exp(-0.1j * slow), rtol=1e-8,
        why="order 4 at half a radian",
    )  # fmt: skip


@examples(25)
@given(st.integers(0, 10_000), st.booleans())
def test_the_order_of_blocks_is_irrelevant(seed: int, delayed: bool) -> None:
    random = np.random.default_rng(seed)
    loop = feedback(random.uniform(0.2, 3.0), 0.05 if delayed else 0.0)
    shuffled = [loop.blocks[k] for k in random.permutation(3)]
    other = fid.connect(shuffled, inputs=["r"], outputs=["y"])
    assert_close(
        other.frequency_response(OMEGA), loop.frequency_response(OMEGA), rtol=1e-12,
        why="the same equations in another order",
    )  # fmt: skip
    assert other.is_stable == loop.is_stable
    record = fid.Record.from_arrays(0.02 * np.arange(60), inputs={"r": random.standard_normal(60)})
    assert_close(
        other.simulate(record)["y"], loop.simulate(record)["y"], atol=1e-12,
        why="the same equations in another order",
    )  # fmt: skip


def test_an_interconnection_is_a_block_of_another() -> None:
    inner = replace(feedback(4.0), name="inner")
    outer = fid.connect([inner, L.washout("y", "e", 1.0)], inputs=["r"], outputs=["e"])
    s = 1j * OMEGA
    closed = 4 * plant(s) / (1 + 4 * plant(s))
    assert_close(
        outer.frequency_response(OMEGA)[0, 0], closed * s / (s + 1), rtol=1e-10, why="in series"
    )
    assert "inner1.u" in outer.signals


def test_words_and_plain_values() -> None:
    loop = fid.connect(
        [*feedback().blocks, L.limiter("y", "y_lim", 1.0), L.rate_limiter("y_lim", "z", 2.0)],
        inputs=["r"],
    )
    ends = "inputs [r], outputs [y, u, e, y_lim, z]"
    assert repr(loop) == f"Interconnection(5 blocks, {ends}, 2 states)"
    assert "limited to -1" in str(loop.summary())
    assert "small motion" in loop.findings[0].message
    assert loop.to_dict()["schema"] == "flightid.interconnection/1"
    found = loop.stability()
    for shown in (loop, found):
        assert "<table>" in shown._repr_html_()
    assert found.to_dict()["stable"] is True
    assert "damping" in str(found.summary())
    assert repr(L.sum_of("e", "r", "-y")) == "Block(sum: [r, y] to [e])"
    assert str(L.gain(("a", "b"), "c", [[1.0, 2.0]])) == "gains 1, 2"
