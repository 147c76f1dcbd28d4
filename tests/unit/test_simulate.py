"""The verb `simulate`: names, units, biases, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from flightid import Record, errors
from flightid.models.linear.linear_system import LinearSystem
from flightid.simulation import simulate
from tests.closeness import assert_close

LAG = LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.5]], ("tau_phi",), ("p",))


@pytest.fixture
def record() -> Record:
    time_s = np.arange(100) * 0.02
    return Record.from_arrays(
        time_s,
        inputs={"tau_phi": np.sin(time_s)},
        outputs={"p": np.zeros(100)},
        units={"p": "rad/s"},
    )


def test_result_carries_names_units_and_history(record: Record) -> None:
    result = simulate(LAG, record)
    assert result.inputs == ("tau_phi",)
    assert result.outputs == ("p",)
    assert result.unit("p") == "rad/s"
    assert result.history[-1].operation == "simulate"
    assert_close(result["tau_phi"], record["tau_phi"], atol=1e-15, why="untouched")
    assert simulate(LAG, record, units={"p": "deg/s"}).unit("p") == "deg/s"


def test_biases_act_as_constants(record: Record) -> None:
    plain, shifted = simulate(LAG, record), simulate(LAG, record, output_bias={"p": 0.3})
    assert_close(shifted["p"] - plain["p"], 0.3, rtol=1e-12, why="an output bias is added")
    pushed = simulate(LAG, record, input_bias={"tau_phi": 1.0})
    step = 0.5 + 1 - np.exp(-2 * record.time_s)
    assert_close(pushed["p"] - plain["p"], step, atol=1e-12, why="a step response")


def test_initial_state_decays(record: Record) -> None:
    free = simulate(LAG, record, initial_state=[1.0])["p"] - simulate(LAG, record)["p"]
    assert_close(free, np.exp(-2 * record.time_s), atol=1e-12, why="free response")


def test_hold_differs_by_half_a_sample(record: Record) -> None:
    fast = simulate(LAG, record, hold="first")["p"]
    slow = simulate(LAG, record, hold="zero")["p"]
    later = LinearSystem(LAG.a, LAG.b, LAG.c, [[0.0]], LAG.inputs, LAG.outputs, [0.01])
    strictly = LinearSystem(LAG.a, LAG.b, LAG.c, [[0.0]], LAG.inputs, LAG.outputs)
    gap = simulate(strictly, record, hold="zero")["p"] - simulate(later, record, hold="first")["p"]
    assert np.abs(fast - slow).max() > 1e-3
    assert np.abs(gap).max() < 1e-4


def test_a_gain_without_states(record: Record) -> None:
    empty = LinearSystem(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[3.0]], ("tau_phi",), ("p",)
    )
    assert_close(simulate(empty, record)["p"], 3 * record["tau_phi"], rtol=1e-14, why="a gain")
    assert repr(empty) == "LinearSystem(0 states, inputs [tau_phi], outputs [p])"


def test_refusals(record: Record) -> None:
    with pytest.raises(errors.ModelError, match="cannot be simulated"):
        simulate(object(), record)  # type: ignore[arg-type]
    with pytest.raises(errors.OptionError, match="hold is not known"):
        simulate(LAG, record, hold="second")  # type: ignore[arg-type]
    with pytest.raises(errors.OptionError, match="a bias has no channel"):
        simulate(LAG, record, output_bias={"q": 1.0})
    with pytest.raises(errors.ShapeError, match="B does not fit"):
        simulate(
            LinearSystem([[1.0]], [[1.0, 2.0]], [[1.0]], [[0.0]], ("tau_phi",), ("p",)), record
        )
    with pytest.raises(errors.ShapeError, match="initial state"):
        simulate(LAG, record, initial_state=[0.0, 0.0])
    with pytest.raises(errors.DataError, match="a delay is negative"):
        simulate(LinearSystem(LAG.a, LAG.b, LAG.c, LAG.d, LAG.inputs, LAG.outputs, [-1.0]), record)
    with pytest.raises(errors.DataError, match="not finite"):
        simulate(LinearSystem([[900.0]], [[1.0]], [[1.0]], [[0.0]], ("tau_phi",), ("p",)), record)
    with pytest.raises(errors.UnknownNameError):
        simulate(LAG, record.replace(channels=[record.channels["p"]]))
